#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/cli/known_fixture.h"
#include "tests/cli/scenes.h"

namespace krot::internal {
namespace {

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
  Words Options() const {
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
    const Model before = SmallRigModel(sensors_per_rig);
    Save(before, folder_ / "input");
    WriteFiles(before);
    const KrotResult result = Succeeded(Solve("input", "output", Options()));
    EXPECT_THAT(result.err, HasSubstr("of which 2 frames and "));
    EXPECT_THAT(result.out, HasSubstr("with what is fixed, no translations"));
    const Json report = Report("output");
    EXPECT_EQ(report["termination"], "gap_reached");
    // Not put back in the end, at the cost of the maximum.
    EXPECT_LE(report["relative_gap"], 6e-4);
    EXPECT_FALSE(report["finish"].is_null());
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
    const KrotResult check = Succeeded(Check("output", "output"));
    EXPECT_THAT(check.out, HasSubstr("as fixed where they stand"));
    Succeeded(Check("input", "output"));
  }
}

TEST_F(WhatIsFixed, ElsewhereAreNotWhatTheCertificateSpeaksOf) {
  Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  WriteFiles(model);
  Succeeded(Solve("input", "output", Options()));
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
  Succeeded(Solve("input", "free"));
  Succeeded(Solve("free", "fixed", Options()));
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
  Succeeded(Solve("whole", "out_whole", Options()));
  Succeeded(Solve("rest", "out_rest",
                  Options() + Words{"--Solver.init", "feasible"}));
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
  EXPECT_THAT(solve("--fixed_images_path", "# a\nnobody.jpg\n"),
              IsRefused(2, "krot solver", "the first has image \"nobody.jpg"));
  const KrotResult point = solve("--fixed_points_path", "99999999\n");
  EXPECT_EQ(point.exit_code, 2);
  EXPECT_THAT(point.err, HasSubstr("found no 3D point of the model"));
  EXPECT_EQ(solve("--fixed_points_path", "\n").exit_code, 2);
  Save(WithoutTranslations(model), folder_ / "input");
  EXPECT_THAT(solve("--fixed_images_path", model.images[1].name).err,
              HasSubstr("which stands nowhere"));
  WriteFiles(model);
  EXPECT_EQ(
      Solve("input", "output", Options() + Words{"--Solver.max_error", "3"})
          .exit_code,
      1);
}

TEST_F(WhatIsFixed, FarAwayIsProvedInItsPlace) {
  const Eigen::Vector3d shift(5e6, -3e6, 4e6);
  const Model model = FarAway(SmallLegacyModel(), shift);
  Save(model, folder_ / "far");
  WriteFiles(model);
  Succeeded(Solve("far", "output", Options()));
  EXPECT_EQ(Report("output")["termination"], "gap_reached");
  const Model after = Load(folder_ / "output");
  for (const size_t f : FixedFramesOf(model)) {
    EXPECT_EQ(after.frames[f].rig_from_world.translation,
              model.frames[f].rig_from_world.translation);
  }
  EXPECT_EQ(after.points3D[0].xyz, model.points3D[0].xyz);
  Succeeded(Check("output", "output"));
}

TEST_F(WhatIsFixed, StaysThroughPolishAndBundleAdjustment) {
  const Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  WriteFiles(model);
  for (const Words& command : std::vector<Words>{
           {"solver", "--Solver.polish", "full"},
           {"bundle_adjuster"},
           {"bundle_adjuster", "--BundleAdjustment.max_error_factor", "1.1"}}) {
    SCOPED_TRACE(::testing::PrintToString(command));
    Succeeded(
        RunKrot(command + Options(), {"--input_path", folder_ / "input",
                                      "--output_path", folder_ / "output"}));
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
}  // namespace krot::internal
