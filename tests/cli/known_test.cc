#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/geometry.h"
#include "tests/cli/known_fixture.h"
#include "tests/cli/scenes.h"

// What else is known than the model says: files beside it.

namespace krot::internal {
namespace {

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
    Succeeded(Solve("whole", "out_whole", {"--overwrite", "1"}));
    const KrotResult result = Succeeded(
        Solve("wiped", "out",
              {"--overwrite", "1", "--rotations_path",
               folder_ / "rotations.txt", "--Solver.init", "feasible"}));
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
      Succeeded(Check("whole", "out"));
    }
    Succeeded(Check("out", "out"));
  }
}

TEST_F(Known, RotationsOfSomeImagesLeaveTheOthersTheirsAndAreCounted) {
  const Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  std::string lines = RotationLines(model);
  lines.erase(lines.rfind('\n', lines.size() - 2) + 1);  // the last image's
  std::ofstream(folder_ / "rotations.txt") << lines;
  Succeeded(Solve("input", "plain"));
  const KrotResult result = Succeeded(Solve(
      "input", "output", {"--rotations_path", folder_ / "rotations.txt"}));
  EXPECT_THAT(result.err, HasSubstr("; 1 image without one"));
  EXPECT_EQ(Report("output")["rotations"]["num_kept_images"], 1);
  EXPECT_THAT(Load(folder_ / "output"), IsModel(Load(folder_ / "plain")));
}

TEST_F(Known, RotationsFromElsewhereLeaveTheBoundToTheNoise) {
  SceneOptions options = SmallScene();
  options.outlier_ratio = 0.02;
  const Model truth = SynthesizeScene(options).ground_truth;
  Save(truth, folder_ / "input");
  std::ofstream(folder_ / "rotations.txt") << RotationLines(truth);
  // No error counts as gross, so that the model's own positions fit.
  const Words arguments =
      Words{"solver",
            "--input_path",
            folder_ / "input",
            "--output_path",
            folder_ / "output",
            "--report_path",
            folder_ / "output.json"} +
      Words{"--Solver.init", "feasible",    "--Problem.init_max_error",
            "1e6",           "--overwrite", "1"};
  Succeeded(RunKrot(arguments));
  EXPECT_TRUE(Report("output")["outliers"].is_null());
  Succeeded(
      RunKrot(arguments, {"--rotations_path", folder_ / "rotations.txt"}));
  EXPECT_GT(Report("output")["outliers"]["num_removed"], 0);
}

// Every image's rotation as somebody else has it.
template <typename Change>
std::string ChangedRotationLines(Model model, const Change& change) {
  for (Image& image : model.images) {
    image.cam_from_world.quaternion_wxyz =
        change(NormalizedQuaternion(image.cam_from_world.quaternion_wxyz));
  }
  return RotationLines(model);
}

QuaternionWxyz Inverted(const Eigen::Quaterniond& q) {
  return ToWxyz(q.conjugate());
}

TEST_F(Known, RotationsInAnotherConventionAreRefusedBeforeTheWork) {
  for (const int sensors_per_rig : {1, 2}) {
    const Model model = SmallRigModel(sensors_per_rig);
    Save(model, folder_ / std::to_string(sensors_per_rig));
    std::ofstream(folder_ / "rotations.txt")
        << ChangedRotationLines(model, &Inverted);
    for (const Words& command :
         {Words{"solver", "--output_path", folder_ / "output"},
          {"outlier_filter", "--output_path", folder_ / "output",
           "--OutlierFilter.max_error", "3"},
          {"tolerance_analyzer", "--ToleranceAnalyzer.max_error", "3"}}) {
      EXPECT_THAT(
          RunKrot(command,
                  {"--input_path", folder_ / std::to_string(sensors_per_rig),
                   "--rotations_path", folder_ / "rotations.txt"}),
          IsRefused(2, "krot " + command[0],
                    "are written a -b -c -d: they are world from "
                    "camera, the inverse"));
    }
    EXPECT_FALSE(std::filesystem::exists(folder_ / "output"));
  }
}

// What the errors cannot decide is not refused.
TEST_F(Known, RotationsInAnotherConventionAreAWarningWithoutPositions) {
  Model model = SmallLegacyModel();
  std::ofstream(folder_ / "rotations.txt")
      << ChangedRotationLines(model, [](const Eigen::Quaterniond& q) {
           return QuaternionWxyz{q.x(), q.y(), q.z(), q.w()};
         });
  model = WithoutTranslations(model);
  Save(model, folder_ / "input");
  const KrotResult result =
      Solve("input", "output", {"--rotations_path", folder_ / "rotations.txt"});
  EXPECT_NE(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("warning: "));
  EXPECT_THAT(result.err,
              HasSubstr("are written d a b c: they are QX QY QZ QW"));
}

TEST_F(Known, RotationsInAnotherWorldFrameGiveTheSameModel) {
  const Model model = SmallRigModel(2);
  Save(model, folder_ / "input");
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized();
  std::ofstream(folder_ / "rotations.txt") << ChangedRotationLines(
      model, [&](const Eigen::Quaterniond& q) { return ToWxyz(q * turn); });
  Succeeded(Solve("input", "plain"));
  const KrotResult result = Succeeded(Solve(
      "input", "output", {"--rotations_path", folder_ / "rotations.txt"}));
  EXPECT_THAT(result.err, HasSubstr("the list is in another world frame"));
  EXPECT_NEAR(Report("output")["rotations"]["frame_turn_deg"],
              Eigen::AngleAxisd(turn).angle() * 180 / M_PI, 1e-6);
  EXPECT_LT(Report("output")["rotations"]["turn_deg"]["max"], 1e-6);
  EXPECT_NEAR(Report("output")["cost_final"], Report("plain")["cost_final"],
              1e-6);
  const Model plain = Load(folder_ / "plain");
  const Model output = Load(folder_ / "output");
  for (size_t f = 0; f < plain.frames.size(); ++f) {
    EXPECT_LT((Center(plain.frames[f].rig_from_world.Transform()) -
               Center(output.frames[f].rig_from_world.Transform()))
                  .norm(),
              1e-3);
  }
}

TEST_F(Known, RotationsThatAreInexactTellByHowMuchTheyTurn) {
  const Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  const Eigen::Quaterniond error(
      Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitX()));
  int n = 0;
  std::ofstream(folder_ / "rotations.txt")
      << ChangedRotationLines(model, [&](const Eigen::Quaterniond& q) {
           return ToWxyz((n++ % 2 == 0 ? error : error.conjugate()) * q);
         });
  const KrotResult result =
      Solve("input", "output", {"--rotations_path", folder_ / "rotations.txt"});
  EXPECT_THAT(result.err, HasSubstr("turned by 0.57 degrees in the median and "
                                    "0.57 at most"));
  EXPECT_THAT(result.err, Not(HasSubstr("warning")));
}

TEST_F(Known, RotationsOfAnyLengthAreWrittenOfUnitLength) {
  const Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  const Eigen::Quaterniond turn(
      Eigen::AngleAxisd(1e-4, Eigen::Vector3d::UnitX()));
  std::ofstream(folder_ / "rotations.txt")
      << ChangedRotationLines(model, [&](const Eigen::Quaterniond& q) {
           QuaternionWxyz longer = ToWxyz(turn * q);
           for (double& number : longer) number *= 1000;
           return longer;
         });
  Succeeded(Solve("input", "output",
                  {"--rotations_path", folder_ / "rotations.txt"}));
  for (const Image& image : Load(folder_ / "output").images) {
    double square = 0;
    for (const double q : image.cam_from_world.quaternion_wxyz) square += q * q;
    EXPECT_NEAR(square, 1, 1e-14);
  }
}

TEST_F(Known, PosesWithTheirHalvesExchangedAreWarnedOf) {
  Model model = SmallLegacyModel();
  for (Image& image : model.images) {
    const QuaternionWxyz q = image.cam_from_world.quaternion_wxyz;
    const Eigen::Vector3d t = 3 * image.cam_from_world.translation;
    image.cam_from_world = {{t[0], t[1], t[2], q[0]}, {q[1], q[2], q[3]}};
  }
  Save(model, folder_ / "input");
  const KrotResult result =
      Succeeded(RunKrot({"model_analyzer", "--path", folder_ / "input"}));
  const std::string count = std::to_string(model.images.size());
  EXPECT_THAT(result.err, HasSubstr("the quaternions of " + count + " of " +
                                    count + " images are far from unit"));
  EXPECT_THAT(result.err, HasSubstr("TX TY TZ and QW QX QY QZ exchanged"));
}

TEST_F(Known, RotationsThatCannotBeReadEndInOneSentence) {
  Save(SmallLegacyModel(), folder_ / "input");
  std::ofstream(folder_ / "rotations.txt") << "nobody.jpg 1 0 0 0\n";
  EXPECT_THAT(
      Solve("input", "output", {"--rotations_path", folder_ / "rotations.txt"}),
      IsRefused(2, "krot solver",
                "rotations.txt: found no image of the "
                "model in its 1 line, the first has "
                "image \"nobody.jpg\""));
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
  Succeeded(RunKrot(
      {"outlier_filter", "--input_path", folder_ / "wiped", "--output_path",
       folder_ / "output", "--OutlierFilter.max_error", "3", "--rotations_path",
       folder_ / "rotations.txt", "--report_path", folder_ / "output.json"}));
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
  const std::vector<Words> commands = {
      {"solver"},
      {"solver", "--Solver.method", "res_int"},
      {"solver", "--Solver.init", "feasible"},
      {"solver", "--Solver.init", "feasible", "--Solver.max_error", "1.2"},
      {"solver", "--fixed_images_path", folder_ / "images.txt"},
      {"point_triangulator"},
      {"outlier_filter", "--OutlierFilter.max_error", "1.2"},
      {"bundle_adjuster", "--BundleAdjustment.max_error", "2"}};
  for (const Words& command : commands) {
    SCOPED_TRACE(::testing::PrintToString(command));
    const bool has_certificate = command[0] == "solver" && command.size() < 3;
    for (const std::string side : {"near", "far"}) {
      const Words paths = {"--input_path",  folder_ / side,
                           "--output_path", folder_ / (side + "_out"),
                           "--overwrite",   "1"};
      const Words proof = {"--certificate_path",
                           folder_ / (side + "_out_proof.json")};
      Succeeded(RunKrot(command + paths, has_certificate ? proof : Words{}));
    }
    EXPECT_LT(LargestDistance(Load(folder_ / "near_out"),
                              Load(folder_ / "far_out"), shift),
              1e-6);
    if (has_certificate) {
      Succeeded(Check("far_out", "far_out"));
      Succeeded(Check("far_out", "near_out"));
    }
  }
}

}  // namespace
}  // namespace krot::internal
