#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/model/model_io.h"
#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

// Models from the wild, if KROT_REAL_MODELS names a folder of them.

constexpr const char* kNoModels = "KROT_REAL_MODELS is not set";

// The readable models: neither pointers nor loose files.
std::vector<fs::path> ReadableModels() {
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(*RealModels())) {
    if (!entry.is_directory()) continue;
    if (entry.path().filename() == "edge_lfs_pointers") continue;
    folders.push_back(entry.path());
  }
  return folders;
}

void Write(const Model& model, const fs::path& folder, ModelFormat format) {
  WriteModelOptions options;
  options.format = format;
  options.overwrite = true;
  WriteModel(model, folder, options);
}

void ExpectSameFiles(const fs::path& written, const fs::path& original) {
  for (const std::string& name : FileNames(written)) {
    EXPECT_TRUE(ReadBytes(written / name) == ReadBytes(original / name))
        << (original / name) << " was written differently";
  }
}

TEST(RealModels, ComeBackByteForByteDirectlyAndThroughText) {
  if (!RealModels()) GTEST_SKIP() << kNoModels;
  const TempFolder folder;
  for (const fs::path& path : ReadableModels()) {
    const ModelFormat format = DetectModelFormat(path);
    const Model model = ReadModel(path, format);
    Write(model, folder / "binary", ModelFormat::kBinary);
    Write(model, folder / "text", ModelFormat::kText);
    const Model from_text = ReadModel(folder / "text", ModelFormat::kText);
    EXPECT_THAT(from_text, IsModel(model)) << path;
    EXPECT_THAT(ReadModel(folder / "binary", ModelFormat::kBinary),
                IsModel(model))
        << path;
    if (format == ModelFormat::kBinary) {
      ExpectSameFiles(folder / "binary", path);
    }
  }
}

TEST(RealModels, AreValid) {
  if (!RealModels()) GTEST_SKIP() << kNoModels;
  for (const fs::path& path : ReadableModels()) {
    const Model model = ReadModel(path, DetectModelFormat(path));
    EXPECT_EQ(ModelErrorOf([&] { ValidateModel(model); }), "") << path;
  }
}

TEST(RealModels, ThatAreGitLfsPointersAreRecognised) {
  if (!RealModels()) GTEST_SKIP() << kNoModels;
  EXPECT_THAT(ModelErrorOf([] {
                ReadModel(*RealModels() / "edge_lfs_pointers",
                          ModelFormat::kBinary);
              }),
              HasSubstr("cameras.bin: is a Git LFS pointer"));
}

std::string DifferenceAfter(const std::function<void(Model*)>& change,
                            const Ignoring& ignoring = Ignoring()) {
  Model changed = TinyRigModel();
  change(&changed);
  return ModelComparison(ignoring).FirstDifference(TinyRigModel(), changed);
}

TEST(IsModel, SaysWhereTwoModelsDifferFirst) {
  EXPECT_EQ(DifferenceAfter([](Model*) {}), "");
  EXPECT_EQ(DifferenceAfter([](Model* m) { m->cameras[1].params[2] = 0.0; }),
            "cameras[1].params[2]: -0 and 0");
  EXPECT_EQ(DifferenceAfter([](Model* m) { m->images.pop_back(); }),
            "images.size(): 3 and 2");
  EXPECT_EQ(DifferenceAfter([](Model* m) {
              m->points3D[0].color = {255, 1, 9};
            }),
            "points3D[0].color[1]: 0 and 1");
  EXPECT_EQ(DifferenceAfter([](Model* m) { m->frames[1].data[0].data_id = 2; }),
            "frames[1].data[0].data_id: 4000000000 and 2");
}

TEST(IsModel, IgnoresOnlyWhatItIsToldTo) {
  const Ignoring everything{true, true, true};
  const auto move = [](Model* m) {
    m->images[0].cam_from_world.translation[0] = 7;
    m->frames[0].rig_from_world.translation[1] = 7;
    m->points3D[1].xyz[2] = 7;
    m->points3D[1].error = 7;
  };
  EXPECT_EQ(DifferenceAfter(move, everything), "");
  EXPECT_EQ(DifferenceAfter(move, {false, true, true}),
            "frames[0].rig_from_world.translation[1]: 2 and 7");
  EXPECT_EQ(DifferenceAfter(move, {true, false, true}),
            "points3D[1].xyz[2]: 4 and 7");
  EXPECT_EQ(DifferenceAfter(move, {true, true, false}),
            "points3D[1].error: -1 and 7");
  EXPECT_EQ(DifferenceAfter(
                [](Model* m) {
                  m->rigs[0].sensors[0].sensor_from_rig->translation[1] = 7;
                },
                everything),
            "rigs[0].sensors[0].sensor_from_rig.translation[1]: "
            "0.29999999999999999 and 7");
}

}  // namespace
}  // namespace krot::internal
