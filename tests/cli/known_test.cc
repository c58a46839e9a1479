#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "krot/geometry/rigid_transform.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

// What else is known than the model says: files beside it.

namespace krot {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

class Known : public ::testing::Test {
 protected:
  KrotResult Solve(const std::string& input, const std::string& output,
                   const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"solver",
                                          "--input_path",
                                          folder_ / input,
                                          "--output_path",
                                          folder_ / output,
                                          "--report_path",
                                          folder_ / (output + ".json"),
                                          "--certificate_path",
                                          folder_ / (output + "_proof.json")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunKrot(arguments);
  }
  Json Report(const std::string& output) const {
    return Json::parse(ReadBytes(folder_ / (output + ".json")));
  }
  KrotResult Check(const std::string& model, const std::string& output) const {
    return RunKrot({"certificate_checker", "--input_path", folder_ / model,
                    "--certificate_path", folder_ / (output + "_proof.json")});
  }

  TempFolder folder_;
};

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
    SceneOptions options = SmallScene();
    options.has_rigs = sensors_per_rig > 1;
    options.sensors_per_rig = sensors_per_rig;
    const Model whole = SynthesizeScene(options).model;
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

// Two images and some points to fix, and the files that say so.
class WhatIsFixed : public Known {
 protected:
  void WriteFiles(const Model& model) const {
    std::ofstream(folder_ / "images.txt") << "# by name and by id\n"
                                          << model.images[0].name << "\n\n"
                                          << model.images.back().id << "\n";
    std::ofstream points(folder_ / "points.txt");
    for (int k = 0; k < 5; ++k) points << model.points3D[3 * k].id << "\n";
  }
  std::vector<std::string> Options() const {
    return {"--fixed_images_path", folder_ / "images.txt",
            "--fixed_points_path", folder_ / "points.txt",
            "--overwrite",         "1"};
  }
};

// The frames of the first and the last image.
std::vector<size_t> FixedFramesOf(const Model& model) {
  std::vector<size_t> frames;
  for (const ImageId id : {model.images[0].id, model.images.back().id}) {
    for (size_t f = 0; f < model.frames.size(); ++f) {
      for (const FrameData& data : model.frames[f].data) {
        if (data.data_id == id) frames.push_back(f);
      }
    }
  }
  return frames;
}

TEST_F(WhatIsFixed, KeepTheirBitsAndAreProvedInTheirPlace) {
  for (const int sensors_per_rig : {1, 2}) {
    SceneOptions scene = SmallScene();
    scene.has_rigs = sensors_per_rig > 1;
    scene.sensors_per_rig = sensors_per_rig;
    const Model before = SynthesizeScene(scene).model;
    Save(before, folder_ / "input");
    WriteFiles(before);
    const KrotResult result = Solve("input", "output", Options());
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.err, HasSubstr("of which 2 frames and "));
    EXPECT_THAT(result.out, HasSubstr("with what is fixed, no translations"));
    const Json report = Report("output");
    EXPECT_EQ(report["termination"], "gap_reached");
    EXPECT_EQ(report["fixed"]["num_frames"], 2);
    // All that see the others are fixed, too.
    EXPECT_GE(report["fixed"]["num_points"], 3);
    EXPECT_LE(report["fixed"]["num_points"], 5);
    EXPECT_GT(report["left_out"]["fixed"], 0);

    const Model after = Load(folder_ / "output");
    for (const size_t f : FixedFramesOf(before)) {
      EXPECT_EQ(after.frames[f].rig_from_world.translation,
                before.frames[f].rig_from_world.translation);
    }
    for (int k = 0; k < 5; ++k) {
      EXPECT_EQ(after.points3D[3 * k].xyz, before.points3D[3 * k].xyz);
    }
    EXPECT_NE(after.points3D[1].xyz, before.points3D[1].xyz);
    const KrotResult check = Check("output", "output");
    EXPECT_EQ(check.exit_code, 0) << check.err;
    EXPECT_THAT(check.out, HasSubstr("as fixed where they stand"));
    EXPECT_EQ(Check("input", "output").exit_code, 0);
  }
}

TEST_F(WhatIsFixed, ElsewhereAreNotWhatTheCertificateSpeaksOf) {
  Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  WriteFiles(model);
  ASSERT_EQ(Solve("input", "output", Options()).exit_code, 0);
  for (const size_t f : FixedFramesOf(model)) {
    model.frames[f].rig_from_world.translation[0] += 1e-9;
    model.images[f].cam_from_world = model.frames[f].rig_from_world;
  }
  for (int k = 0; k < 5; ++k) model.points3D[3 * k].xyz[0] += 1e-9;
  Save(model, folder_ / "moved");
  const KrotResult check = Check("moved", "output");
  EXPECT_EQ(check.exit_code, 4);
  EXPECT_THAT(check.err, HasSubstr("is not where the certificate takes it"));
}

TEST_F(WhatIsFixed, OfAnOptimumHaveTheSameOptimum) {
  const Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  WriteFiles(model);
  ASSERT_EQ(Solve("input", "free").exit_code, 0);
  ASSERT_EQ(Solve("free", "fixed", Options()).exit_code, 0);
  const Json free = Report("free");
  const Json fixed = Report("fixed");
  EXPECT_GE(fixed["lower_bound"],
            (1 - 2e-4) * free["lower_bound"].get<double>());
  EXPECT_LE(fixed["lower_bound"], free["cost_final"]);
  EXPECT_LE(fixed["cost_final"], (1 + 1e-3) * free["cost_final"].get<double>());
}

TEST_F(WhatIsFixed, HoldTheRestOfAModelThatHasNothingElse) {
  const Model whole = SmallLegacyModel();
  WriteFiles(whole);
  Model rest = WithoutTranslations(whole);
  for (size_t k = 0; k < rest.points3D.size(); ++k) {
    if (k % 3 != 0 || k >= 15) rest.points3D[k].xyz.setZero();
  }
  for (const size_t f : FixedFramesOf(whole)) {
    rest.frames[f].rig_from_world = whole.frames[f].rig_from_world;
    rest.images[f].cam_from_world = whole.images[f].cam_from_world;
  }
  Save(whole, folder_ / "whole");
  Save(rest, folder_ / "rest");
  ASSERT_EQ(Solve("whole", "out_whole", Options()).exit_code, 0);
  std::vector<std::string> options = Options();
  options.insert(options.end(), {"--Solver.init", "feasible"});
  const KrotResult result = Solve("rest", "out_rest", options);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Json expected = Report("out_whole");
  const Json found = Report("out_rest");
  EXPECT_EQ(found["num_observations"], expected["num_observations"]);
  EXPECT_EQ(found["termination"], "gap_reached");
  EXPECT_LE(found["lower_bound"], expected["cost_final"]);
  EXPECT_LE(expected["lower_bound"], found["cost_final"]);
}

TEST_F(WhatIsFixed, ThatCannotBeMeantAreRefused) {
  const Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  const auto solve = [&](const std::string& option, const std::string& text) {
    std::ofstream(folder_ / "list.txt") << text;
    return Solve("input", "output", {option, folder_ / "list.txt"});
  };
  const KrotResult image = solve("--fixed_images_path", "# a\nnobody.jpg\n");
  EXPECT_EQ(image.exit_code, 2);
  EXPECT_THAT(image.err,
              IsOneSentence("krot solver", "list.txt:2: found \"nobody.jpg\""));
  const KrotResult point = solve("--fixed_points_path", "99999999\n");
  EXPECT_EQ(point.exit_code, 2);
  EXPECT_THAT(point.err, HasSubstr("the id of a 3D point of the model"));
  EXPECT_EQ(solve("--fixed_points_path", "\n").exit_code, 2);
  Save(WithoutTranslations(model), folder_ / "input");
  EXPECT_THAT(solve("--fixed_images_path", model.images[1].name).err,
              HasSubstr("which stands nowhere"));
  WriteFiles(model);
  std::vector<std::string> options = Options();
  options.insert(options.end(), {"--Solver.max_error", "3"});
  EXPECT_EQ(Solve("input", "output", options).exit_code, 1);
}

// 100 times as large and `shift` away, as in UTM or ECEF coordinates.
Model FarAway(const Model& model, const Eigen::Vector3d& shift) {
  const auto move = [&](Pose* pose) {
    using Real = long double;
    pose->translation = (100 * pose->translation.cast<Real>() -
                         pose->Rotation().cast<Real>() * shift.cast<Real>())
                            .cast<double>();
  };
  Model far = model;
  for (Frame& frame : far.frames) move(&frame.rig_from_world);
  for (Image& image : far.images) move(&image.cam_from_world);
  for (Point3D& point : far.points3D) point.xyz = 100 * point.xyz + shift;
  return far;
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

TEST_F(WhatIsFixed, FarAwayIsProvedInItsPlace) {
  const Eigen::Vector3d shift(5e6, -3e6, 4e6);
  const Model model = FarAway(SmallLegacyModel(), shift);
  Save(model, folder_ / "far");
  WriteFiles(model);
  const KrotResult result = Solve("far", "output", Options());
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(Report("output")["termination"], "gap_reached");
  const Model after = Load(folder_ / "output");
  for (const size_t f : FixedFramesOf(model)) {
    EXPECT_EQ(after.frames[f].rig_from_world.translation,
              model.frames[f].rig_from_world.translation);
  }
  EXPECT_EQ(after.points3D[0].xyz, model.points3D[0].xyz);
  const KrotResult check = Check("output", "output");
  EXPECT_EQ(check.exit_code, 0) << check.err;
}

TEST_F(WhatIsFixed, StaysThroughPolishAndBundleAdjustment) {
  const Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  WriteFiles(model);
  for (std::vector<std::string> command : std::vector<std::vector<std::string>>{
           {"solver", "--Solver.polish", "full"},
           {"bundle_adjuster"},
           {"bundle_adjuster", "--BundleAdjustment.max_error_factor", "1.1"}}) {
    SCOPED_TRACE(::testing::PrintToString(command));
    const std::vector<std::string> options = Options();
    command.insert(command.end(), options.begin(), options.end());
    command.insert(command.end(), {"--input_path", folder_ / "input",
                                   "--output_path", folder_ / "output"});
    const KrotResult result = RunKrot(command);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const Model after = Load(folder_ / "output");
    for (const size_t f : FixedFramesOf(model)) {
      EXPECT_EQ(after.frames[f].rig_from_world.translation,
                model.frames[f].rig_from_world.translation);
      EXPECT_EQ(after.frames[f].rig_from_world.quaternion_wxyz,
                model.frames[f].rig_from_world.quaternion_wxyz);
    }
    for (int k = 0; k < 5; ++k) {
      EXPECT_EQ(after.points3D[3 * k].xyz, model.points3D[3 * k].xyz);
    }
    EXPECT_NE(after.points3D[1].xyz, model.points3D[1].xyz);
  }
}

}  // namespace
}  // namespace krot
