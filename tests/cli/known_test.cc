#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "krot/geometry/rigid_transform.h"
#include "tests/cli/known_fixture.h"
#include "tests/cli/scenes.h"

// What else is known than the model says: files beside it.

namespace krot {
namespace {

using ::testing::HasSubstr;

// The rotations of all images, as a file has them.
std::string RotationLines(const Model& model) {
  std::ostringstream lines;
  lines.precision(17);
  lines << "# NAME QW QX QY QZ\n";
  for (const Image& image : model.images) {
    lines << image.name;
    for (const double q : image.cam_from_world.quaternion_wxyz) {
      lines << " " << q;
    }
    lines << "\n";
  }
  return lines.str();
}

// Without translations, points and rotations.
Model Wiped(const Model& model) {
  Model wiped = WithoutTranslations(model);
  for (Point3D& point : wiped.points3D) point.xyz.setZero();
  for (Frame& frame : wiped.frames) {
    frame.rig_from_world.quaternion_wxyz = {1, 0, 0, 0};
  }
  for (Image& image : wiped.images) {
    image.cam_from_world.quaternion_wxyz = {1, 0, 0, 0};
  }
  return wiped;
}

TEST_F(Known, RotationsAloneGiveAWipedModelTheCertifiedOptimumOfTheWhole) {
  for (const int sensors_per_rig : {1, 2}) {
    const Model whole = SmallRigModel(sensors_per_rig);
    Save(whole, folder_ / "whole");
    Save(Wiped(whole), folder_ / "wiped");
    std::ofstream(folder_ / "rotations.txt") << RotationLines(whole);
    ASSERT_EQ(Solve("whole", "out_whole", {"--overwrite", "1"}).exit_code, 0);
    const KrotResult result =
        Solve("wiped", "out",
              {"--overwrite", "1", "--rotations_path",
               folder_ / "rotations.txt", "--Solver.init", "feasible"});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.err, HasSubstr("0 images without one"));
    const Json expected = Report("out_whole");
    const Json found = Report("out");
    EXPECT_EQ(found["termination"], "gap_reached");
    EXPECT_EQ(found["num_observations"], expected["num_observations"]);
    EXPECT_EQ(found["rotations"]["num_frames"], whole.frames.size());
    EXPECT_TRUE(expected["rotations"].is_null());
    // Two proofs of one optimum, each within the gap and the finish's slack.
    EXPECT_LE(found["lower_bound"], expected["cost_final"]);
    EXPECT_LE(expected["lower_bound"], found["cost_final"]);
    EXPECT_LE(found["relative_gap"], 1e-3);
    if (sensors_per_rig == 1) {
      // Of the same cameras and rotations, so that the proof is one of both.
      EXPECT_EQ(Check("whole", "out").exit_code, 0);
    }
    EXPECT_EQ(Check("out", "out").exit_code, 0);
  }
}

TEST_F(Known, RotationsOfSomeImagesLeaveTheOthersTheirsAndAreCounted) {
  const Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  std::string lines = RotationLines(model);
  lines.erase(lines.rfind('\n', lines.size() - 2) + 1);  // the last image's
  std::ofstream(folder_ / "rotations.txt") << lines;
  ASSERT_EQ(Solve("input", "plain").exit_code, 0);
  const KrotResult result =
      Solve("input", "output", {"--rotations_path", folder_ / "rotations.txt"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("; 1 image without one"));
  EXPECT_EQ(Report("output")["rotations"]["num_kept_images"], 1);
  EXPECT_THAT(Load(folder_ / "output"), IsModel(Load(folder_ / "plain")));
}

TEST_F(Known, RotationsThatCannotBeReadEndInOneSentence) {
  Save(SmallLegacyModel(), folder_ / "input");
  std::ofstream(folder_ / "rotations.txt") << "nobody.jpg 1 0 0 0\n";
  const KrotResult result =
      Solve("input", "output", {"--rotations_path", folder_ / "rotations.txt"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, IsOneSentence("krot solver",
                                        "rotations.txt:1: found \"nobody.jpg"));
  EXPECT_EQ(Solve("input", "output", {"--rotations_path", folder_ / "none"})
                .exit_code,
            2);
}

TEST_F(Known, RotationsMayBeFiltered) {
  SceneOptions options = SmallScene();
  options.outlier_ratio = 0.05;
  const Model whole = SynthesizeScene(options).model;
  Save(Wiped(whole), folder_ / "wiped");
  std::ofstream(folder_ / "rotations.txt") << RotationLines(whole);
  const KrotResult result = RunKrot(
      {"outlier_filter", "--input_path", folder_ / "wiped", "--output_path",
       folder_ / "output", "--OutlierFilter.max_error", "3", "--rotations_path",
       folder_ / "rotations.txt", "--report_path", folder_ / "output.json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(Report("output")["is_within"]);
  EXPECT_EQ(Report("output")["rotations"]["num_kept_images"], 0);
}

// The largest distance of points and frames of `far` from those of `near`.
double LargestDistance(const Model& near, const Model& far,
                       const Eigen::Vector3d& shift) {
  double largest = 0;
  for (size_t k = 0; k < near.points3D.size(); ++k) {
    largest = std::max(
        largest, (far.points3D[k].xyz - shift - near.points3D[k].xyz).norm());
  }
  for (size_t f = 0; f < near.frames.size(); ++f) {
    largest = std::max(
        largest, (Center(far.frames[f].rig_from_world.Transform()) - shift -
                  Center(near.frames[f].rig_from_world.Transform()))
                     .norm());
  }
  return largest;
}

TEST_F(Known, CoordinatesFarAwayShiftTheResultAndNothingElse) {
  const Eigen::Vector3d shift(5e6, -3e6, 4e6);
  const Model model = SmallLegacyModel();
  const Model near = FarAway(model, Eigen::Vector3d::Zero());
  Save(near, folder_ / "near");
  Save(FarAway(model, shift), folder_ / "far");
  std::ofstream(folder_ / "images.txt") << near.images[1].name << "\n"
                                        << near.images[4].name << "\n";
  const std::vector<std::vector<std::string>> commands = {
      {"solver"},
      {"solver", "--Solver.method", "res_int"},
      {"solver", "--Solver.init", "feasible"},
      {"solver", "--fixed_images_path", folder_ / "images.txt"},
      {"point_triangulator"},
      {"outlier_filter", "--OutlierFilter.max_error", "1.2"},
      {"bundle_adjuster", "--BundleAdjustment.max_error", "2"}};
  for (std::vector<std::string> command : commands) {
    SCOPED_TRACE(::testing::PrintToString(command));
    const bool has_certificate = command[0] == "solver" && command.size() < 3;
    for (const std::string side : {"near", "far"}) {
      std::vector<std::string> arguments = command;
      arguments.insert(arguments.end(),
                       {"--input_path", folder_ / side, "--output_path",
                        folder_ / (side + "_out"), "--overwrite", "1"});
      if (has_certificate) {
        arguments.insert(
            arguments.end(),
            {"--certificate_path", folder_ / (side + "_out_proof.json")});
      }
      const KrotResult result = RunKrot(arguments);
      ASSERT_EQ(result.exit_code, 0) << result.err;
    }
    EXPECT_LT(LargestDistance(Load(folder_ / "near_out"),
                              Load(folder_ / "far_out"), shift),
              1e-6);
    if (has_certificate) {
      EXPECT_EQ(Check("far_out", "far_out").exit_code, 0);
      EXPECT_EQ(Check("far_out", "near_out").exit_code, 0);
    }
  }
}

}  // namespace
}  // namespace krot
