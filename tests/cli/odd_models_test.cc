#include <algorithm>
#include <limits>
#include <string>
#include <unordered_map>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/model/rigs.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"
#include "tests/testing/edit_model.h"

namespace krot::internal {
namespace {

// Models that are not as COLMAP's mapper writes them, and that COLMAP reads.

class OddModels : public ::testing::Test {
 protected:
  // Runs the command on "input" into "output".
  KrotResult Run(const Words& words) const {
    Words paths = {"--input_path", folder_ / "input"};
    if (words[0] != "tolerance_analyzer" && words[0] != "model_analyzer") {
      paths = paths +
              Words{"--output_path", folder_ / "output", "--overwrite", "1"};
    }
    return RunKrot(words, paths);
  }

  TempFolder folder_;
  const std::vector<Words> kCommands = {
      {"solver"},
      {"point_triangulator"},
      {"bundle_adjuster", "--BundleAdjustmentCeres.num_threads", "1"},
      {"outlier_filter", "--OutlierFilter.max_error", "40"},
      {"tolerance_analyzer", "--ToleranceAnalyzer.max_error", "40",
       "--ToleranceAnalyzer.images", "1"},
      {"model_analyzer"}};
};

// A 2D point that no 3D point claims, first in the image: the indices of the
// others grow.
Model With2DPointsThatAreNaN(Model model) {
  for (Image& image : model.images) {
    image.points2D.insert(image.points2D.begin(),
                          {kNaN, kNaN, kInvalidPoint3DId});
  }
  for (TrackElement& element : model.track_elements) ++element.point2D_idx;
  return model;
}

// As COLMAP's image_undistorter writes them.
TEST_F(OddModels, With2DPointsThatAreNaNGiveTheResultsOfThoseWithout) {
  const Model model = SmallLegacyModel();
  for (const ModelFormat format : {ModelFormat::kBinary, ModelFormat::kText}) {
    for (const Words& command : kCommands) {
      SCOPED_TRACE(command[0]);
      Save(model, folder_ / "input", format);
      Succeeded(Run(command));
      const bool writes = std::filesystem::exists(folder_ / "output");
      const Model expected =
          writes ? With2DPointsThatAreNaN(Load(folder_ / "output")) : Model();
      Save(With2DPointsThatAreNaN(model), folder_ / "input", format);
      const KrotResult result = Succeeded(Run(command));
      EXPECT_THAT(result.err,
                  HasSubstr(": 6 2D points in no track whose coordinates are "
                            "not finite: kept as read, and left out"));
      if (writes) {
        EXPECT_THAT(Load(folder_ / "output"), IsModel(expected));
      }
      std::filesystem::remove_all(folder_ / "output");
    }
  }
}

// One more image, which is written with a placeholder for a pose.
Model WithUnregisteredImage(Model model, const Pose& pose) {
  Image image;
  image.id = 1000;
  image.camera_id = model.cameras[0].id;
  image.name = "unregistered.jpg";
  image.cam_from_world = pose;
  image.points2D = {{10, 20, kInvalidPoint3DId}};
  model.images.push_back(image);
  model.frames.push_back({1000,
                          model.rigs[0].id,
                          pose,
                          {{{kSensorTypeCamera, image.camera_id}, image.id}}});
  return model;
}

TEST_F(OddModels, WithAnImageOfNoPoseGiveTheResultsOfThoseWithout) {
  for (const Pose& pose :
       {Pose{{0, 0, 0, 0}, {0, 0, 0}}, Pose{{0, 0, 0, 0}, {1, 2, 3}},
        Pose{{2, 0, 0, 1}, {kNaN, kNaN, kNaN}},
        Pose{{kNaN, kNaN, kNaN, kNaN}, {kNaN, kNaN, kNaN}}}) {
    for (const Model& model : {SmallLegacyModel(), SmallRigModel(2)}) {
      for (const Words& command : kCommands) {
        SCOPED_TRACE(command[0]);
        Save(model, folder_ / "input");
        Succeeded(Run(command));
        const bool writes = std::filesystem::exists(folder_ / "output");
        const Model expected =
            writes ? WithUnregisteredImage(Load(folder_ / "output"), pose)
                   : Model();
        Save(WithUnregisteredImage(model, pose), folder_ / "input");
        const KrotResult result = Succeeded(Run(command));
        EXPECT_EQ(result.err.find(": 1 image without a rotation, so without a "
                                  "pose: kept as read") != std::string::npos,
                  !HasRotation(pose.quaternion_wxyz))
            << result.err;
        if (writes) {
          EXPECT_THAT(Load(folder_ / "output"), IsModel(expected));
        }
        std::filesystem::remove_all(folder_ / "output");
      }
    }
  }
}

// Its observations cannot be used; from nothing but rotations, neither.
TEST_F(OddModels, WithObservationsInAnImageOfNoRotationLeaveThemOut) {
  Model model = SmallLegacyModel();
  model.images[0].cam_from_world.quaternion_wxyz = {0, 0, 0, 0};
  UseTrivialRigs(&model);
  Save(model, folder_ / "input");
  const auto num_observations =
      std::count_if(model.track_elements.begin(), model.track_elements.end(),
                    [&](const TrackElement& element) {
                      return element.image_id == model.images[0].id;
                    });
  for (const char* init : {"model", "feasible"}) {
    const KrotResult result = Succeeded(Run({"solver", "--Solver.init", init}));
    EXPECT_THAT(result.out,
                HasSubstr("no_pose " + std::to_string(num_observations)));
    EXPECT_EQ(Load(folder_ / "output").images[0].cam_from_world.quaternion_wxyz,
              (QuaternionWxyz{0, 0, 0, 0}));
  }
}

// Of errors whose squares no number holds nothing can be told.
TEST_F(OddModels, BeyondAllPixelsAreRefusedByTheirPlace) {
  const Model sound = SmallLegacyModel();
  for (const bool is_camera : {false, true}) {
    Model model = sound;
    double& value =
        is_camera ? model.cameras[0].params[0] : PixelOf(&model, 0).x;
    value = 1e160;
    Save(model, folder_ / "input");
    for (const char* command :
         {"bundle_adjuster", "outlier_filter", "model_checker"}) {
      const KrotResult result = Run({command});
      EXPECT_EQ(result.exit_code, 2) << command;
      EXPECT_THAT(result.err, HasSubstr("1e+160, expected a finite number"));
    }
  }
}

// 5,000 km from the origin, where models are solved in a frame of their own.
TEST_F(OddModels, FarAwayKeepAnImageOfNoRotation) {
  const Pose zeros{{0, 0, 0, 0}, {0, 0, 0}};
  Save(WithUnregisteredImage(FarAway(SmallLegacyModel(), {4e6, 3e6, 0}), zeros),
       folder_ / "input");
  Succeeded(Run({"solver"}));
  const Model after = Load(folder_ / "output");
  EXPECT_EQ(after.images.back().cam_from_world.translation,
            Eigen::Vector3d::Zero());
}

// All pay for it: the cure is another command.
TEST_F(OddModels, WithAWrongObservationPointToTheOutlierFilter) {
  Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  const KrotResult sound = Succeeded(Run({"solver"}));
  EXPECT_THAT(sound.err, Not(HasSubstr("outlier_filter")));
  const TrackElement& element = model.track_elements[5];
  const auto image =
      std::find_if(model.images.begin(), model.images.end(),
                   [&](const Image& i) { return i.id == element.image_id; });
  image->points2D[element.point2D_idx].x += 300;
  Save(model, folder_ / "input");
  const KrotResult result = Succeeded(Run({"solver"}));
  EXPECT_THAT(result.err, HasSubstr("warning: the mean error has risen from "));
  EXPECT_THAT(result.err, HasSubstr("krot outlier_filter removes them"));
  // Where they are removed there is nothing to say.
  const KrotResult filtered = Run({"solver", "--Solver.max_error", "4"});
  EXPECT_THAT(filtered.err, Not(HasSubstr("mean error has risen")));
}

// Its observations are right, only its position is not: it comes back, and does
// not take the others along.
TEST_F(OddModels, WithACameraFarAwayIsNamedAndTheOthersKeepTheirPlace) {
  Model model = SmallLegacyModel();
  for (Pose* pose :
       {&model.images[3].cam_from_world, &model.frames[3].rig_from_world}) {
    pose->translation *= 1e5;
  }
  Save(model, folder_ / "input");
  for (const Words& command :
       {Words{"solver"},
        Words{"outlier_filter", "--OutlierFilter.max_error", "3"}}) {
    SCOPED_TRACE(command[0]);
    const KrotResult result =
        Succeeded(Run(command + Words{"--report_path", folder_ / "r.json"}));
    if (command[0] == "solver") {
      const Json not_held = ReadJson(folder_ / "r.json")["not_held"];
      ASSERT_EQ(not_held["images"].size(), 1);
      EXPECT_EQ(not_held["images"][0]["image_id"], model.images[3].id);
      EXPECT_THAT(result.out, HasSubstr("1 image moved farther than cameras"));
      EXPECT_THAT(result.out, HasSubstr(": " + model.images[3].name + " ("));
      EXPECT_THAT(result.out, HasSubstr("those of the other 5 images."));
    }
    const Model solved = Load(folder_ / "output");
    for (size_t n = 0; n < model.images.size(); ++n) {
      if (n == 3) continue;
      EXPECT_LT((solved.images[n].cam_from_world.translation -
                 model.images[n].cam_from_world.translation)
                    .norm(),
                0.1);
    }
  }
}

// From nothing to a certified model, for every camera model, by the command
// line; COLMAP finds the same errors in it.

constexpr int kLastOfColmap38 = 10;

class EveryCameraOfCommands : public ::testing::TestWithParam<int> {
 protected:
  std::string ModelName() const {
    return std::string(FindCameraModel(GetParam())->name);
  }
  // Wide: up to 81 degrees off the axis, or all around.
  void SynthesizeAndSolve() const {
    Succeeded(RunKrot({"model_synthesizer", "--output_path", folder_ / "input",
                       "--Scene.camera_model", ModelName(),
                       "--Scene.focal_length_factor", "0.5",
                       "--Scene.num_frames", "6", "--Scene.num_points", "60",
                       "--Scene.track_length", "4", "--Scene.pixel_noise", "1",
                       "--Scene.start_point_noise", "0.01"}));
    Succeeded(
        RunKrot({"solver", "--input_path", folder_ / "input", "--output_path",
                 folder_ / "output", "--report_path", folder_ / "report.json",
                 "--certificate_path", folder_ / "certificate.json"}));
  }

  TempFolder folder_;
};

// Those that Debian's COLMAP knows.
class EveryCameraOfColmap : public EveryCameraOfCommands {};

std::string CameraName(const ::testing::TestParamInfo<int>& test) {
  return std::string(FindCameraModel(test.param)->name);
}

INSTANTIATE_TEST_SUITE_P(Models, EveryCameraOfCommands, ::testing::Range(0, 18),
                         CameraName);
INSTANTIATE_TEST_SUITE_P(Models, EveryCameraOfColmap,
                         ::testing::Range(0, kLastOfColmap38 + 1), CameraName);

TEST_P(EveryCameraOfCommands, IsSynthesizedSolvedAndCertified) {
  SynthesizeAndSolve();
  const auto report = ReadJson(folder_ / "report.json");
  EXPECT_EQ(report["termination"], "gap_reached");
  EXPECT_EQ(report["certified"], true);
  EXPECT_LT(report["cost_final"], report["cost_initial"].get<double>());
  Succeeded(RunKrot({"certificate_checker", "--input_path", folder_ / "output",
                     "--certificate_path", folder_ / "certificate.json"}));
}

TEST_P(EveryCameraOfColmap, HasTheErrorsThatColmapFinds) {
  if (!HasColmap()) GTEST_SKIP() << "colmap is not installed";
  SynthesizeAndSolve();
  std::filesystem::create_directories(folder_ / "filtered");
  ASSERT_TRUE(
      RunColmap({"point_filtering", "--max_reproj_error", "1e6",
                 "--min_tri_angle", "0", "--input_path", folder_ / "output",
                 "--output_path", folder_ / "filtered"},
                folder_ / "log"))
      << ReadBytes(folder_ / "log");
  std::unordered_map<Point3DId, double> of_colmap;
  for (const Point3D& point : Load(folder_ / "filtered").points3D) {
    of_colmap[point.id] = point.error;
  }
  const Model model = Load(folder_ / "output");
  ASSERT_EQ(of_colmap.size(), model.points3D.size());
  for (const Point3D& point : model.points3D) {
    EXPECT_NEAR(point.error, of_colmap.at(point.id), 1e-6);
  }
}

}  // namespace
}  // namespace krot::internal
