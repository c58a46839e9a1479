#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/model/model_io.h"
#include "tests/testing/model_matchers.h"

// Models from the wild, if KROT_REAL_MODELS names a folder of them.

namespace krot::internal {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

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

}  // namespace
}  // namespace krot::internal
