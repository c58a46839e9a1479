#include "krot/model/derived_models.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

// Three cameras and a point within 100 m of `around`.
Model ModelAround(const Vector3d& around) {
  Model model = TinyModel();
  model.points3D.resize(1);
  model.points3D[0].track_begin = model.points3D[0].track_end = 0;
  model.track_elements.clear();
  model.points3D[0].xyz = around + Vector3d(3, 1.0 / 3, 7);
  for (size_t n = 0; n < model.images.size(); ++n) {
    Pose& pose = model.images[n].cam_from_world;
    pose.translation =
        -(pose.Rotation() *
          (around + 50.0 * Vector3d(std::cos(n), std::sin(n), 0.1)));
  }
  UseTrivialRigs(&model);
  return model;
}

const Vector3d kFarAway(5e6, -3e6, 4e6);

TEST(LocalFrame, IsTheModelsWhereThatIsAmidTheModel) {
  const Model model = ModelAround({20, 10, 0});
  const LocalFrame frame(model);
  EXPECT_TRUE(frame.IsModels());
  EXPECT_THAT(frame.ToLocal(model), IsModel(model));
  EXPECT_TRUE(LocalFrame(TinyModel()).IsModels());
}

TEST(LocalFrame, PutsItsOriginAmidAModelFarAwayAndTakesTheModelAlong) {
  const Model model = ModelAround(kFarAway);
  const LocalFrame frame(model);
  EXPECT_LT((frame.origin() - kFarAway).norm(), 200);
  const Model local = frame.ToLocal(model);
  EXPECT_EQ(local.points3D[0].xyz, model.points3D[0].xyz - frame.origin());
  const auto was = ImageGeometries(model);
  const auto is = ImageGeometries(local);
  for (size_t n = 0; n < was.size(); ++n) {
    EXPECT_LT((Center(is[n].cam_from_world) + frame.origin() -
               Center(was[n].cam_from_world))
                  .norm(),
              1e-8);
    EXPECT_EQ(local.images[n].cam_from_world.translation,
              local.frames[is[n].frame].rig_from_world.translation);
  }
}

TEST(LocalFrame, IsAmidAModelTenExtentsAway) {
  // The cameras are some 50 m apart.
  EXPECT_TRUE(LocalFrame(ModelAround({0, 100, 0})).IsModels());
  EXPECT_FALSE(LocalFrame(ModelAround({0, 1000, 0})).IsModels());
}

TEST(LocalFrame, GivesWhatStaysThereItsBitsBack) {
  Model model = ModelAround(kFarAway);
  model.points3D.push_back(model.points3D[0]);
  model.points3D[1].id = 1;
  model.points3D[1].xyz = Vector3d(0.1, 1e-9, 1e9);  // not amid it
  model.images[1].cam_from_world.translation.setConstant(
      std::numeric_limits<double>::quiet_NaN());
  UseTrivialRigs(&model);
  const LocalFrame frame(model);
  ASSERT_FALSE(frame.IsModels());
  Model local = frame.ToLocal(model);
  EXPECT_THAT(frame.FromLocal(model, local), IsModel(model));

  local.points3D[0].xyz += Vector3d(0.5, 0, 0);
  const Model moved = frame.FromLocal(model, local);
  EXPECT_EQ(moved.points3D[0].xyz, model.points3D[0].xyz + Vector3d(0.5, 0, 0));
  EXPECT_EQ(moved.points3D[1].xyz, model.points3D[1].xyz);
}

TEST(LocalFrame, IsAmidWhatIsFixed) {
  Model model = ModelAround(Vector3d::Zero());
  model.points3D.push_back(model.points3D[0]);
  model.points3D[0].xyz = kFarAway;
  model.points3D[1].id = 1;
  model.points3D[1].xyz = kFarAway + Vector3d(10, 0, 0);
  FixedParts fixed;
  fixed.points3D.assign(2, 1);
  EXPECT_TRUE(LocalFrame(model).IsModels());
  EXPECT_LT((LocalFrame(model, fixed).origin() - kFarAway).norm(), 20);
}

// COLMAP itself as the judge, if it is installed.

bool HasColmap() {
  return std::system("command -v colmap >/dev/null 2>&1") == 0;
}

// `type` is BIN or TXT.
void Convert(const fs::path& input, const fs::path& output,
             const std::string& type) {
  fs::create_directories(output);
  const std::string command =
      "QT_QPA_PLATFORM=offscreen colmap model_converter --input_path '" +
      input.string() + "' --output_path '" + output.string() +
      "' --output_type " + type + " >/dev/null 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
}

void WriteForColmap(const Model& model, const fs::path& folder,
                    ModelFormat format) {
  WriteModelOptions options;
  options.format = format;
  WriteModel(model, folder, options);
}

// The tiny model with what COLMAP 3.8 would alter taken out: it normalises
// quaternions, and its text reader stops names at blanks and knows no NaN.
Model TinyColmapModel() {
  Model model = TinyModel();
  model.images[0].name = "left/ab.jpg";
  model.images[1].cam_from_world.translation = {1, 2, 3};
  model.images[2].cam_from_world.quaternion_wxyz = {0, 0, 1, 0};
  UseTrivialRigs(&model);
  return model;
}

template <typename Record>
void SortById(std::vector<Record>* records) {
  std::sort(records->begin(), records->end(),
            [](const Record& a, const Record& b) { return a.id < b.id; });
}

// COLMAP 3.8 writes images and points in the order of a hash table.
Model Sorted(Model model) {
  SortById(&model.cameras);
  SortById(&model.images);
  UseTrivialRigs(&model);
  SortById(&model.points3D);
  std::vector<TrackElement> track_elements;
  for (Point3D& point : model.points3D) {
    const auto begin = model.track_elements.begin();
    const uint64_t new_begin = track_elements.size();
    track_elements.insert(track_elements.end(), begin + point.track_begin,
                          begin + point.track_end);
    point.track_begin = new_begin;
    point.track_end = track_elements.size();
  }
  model.track_elements = track_elements;
  return model;
}

TEST(Colmap, ReadsWhatIsWrittenHereAndWritesWhatIsReadHere) {
  if (!HasColmap()) GTEST_SKIP() << "colmap is not installed";
  const Model model = TinyColmapModel();
  const TempFolder folder;
  WriteForColmap(model, folder / "binary", ModelFormat::kBinary);
  WriteForColmap(model, folder / "text", ModelFormat::kText);
  Convert(folder / "binary", folder / "binary-to-text", "TXT");
  Convert(folder / "text", folder / "text-to-binary", "BIN");

  const Model from_text =
      ReadModel(folder / "binary-to-text", ModelFormat::kText);
  const Model from_binary =
      ReadModel(folder / "text-to-binary", ModelFormat::kBinary);
  EXPECT_THAT(Sorted(from_text), IsModel(Sorted(model)));
  EXPECT_THAT(Sorted(from_binary), IsModel(Sorted(model)));

  WriteForColmap(from_binary, folder / "again", ModelFormat::kBinary);
  for (const std::string& name : FileNames(folder / "again")) {
    EXPECT_EQ(ReadBytes(folder / "again" / name),
              ReadBytes(folder / "text-to-binary" / name))
        << name;
  }
}

}  // namespace
}  // namespace krot::internal
