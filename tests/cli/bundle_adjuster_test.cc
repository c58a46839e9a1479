#include <cmath>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/camera/camera_model.h"
#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

namespace krot::internal {
namespace {

using ::testing::AllOf;

class BundleAdjuster : public ::testing::Test {
 protected:
  BundleAdjuster() { Save(SmallLegacyModel(), folder_ / "input"); }

  KrotResult Adjust(const Words& more) const {
    return RunKrot({"bundle_adjuster", "--input_path", folder_ / "input",
                    "--output_path", folder_ / "output", "--overwrite", "1",
                    "--report_path", folder_ / "report.json"},
                   more);
  }

  Json Report() const { return ReadJson(folder_ / "report.json"); }

  TempFolder folder_;
};

TEST_F(BundleAdjuster, LowersTheRmsErrorAndReportsIt) {
  const KrotResult result = Succeeded(Adjust({}));
  EXPECT_THAT(result.out, HasSubstr("Converged after"));
  EXPECT_THAT(result.err, HasSubstr("iteration 0: cost "));
  const Json report = Report();
  EXPECT_EQ(report["termination"], "converged");
  const PixelErrorStatistics errors =
      Summarize(PixelErrors(Load(folder_ / "output")));
  EXPECT_NEAR(report["pixel_error"]["after"]["rms"], errors.rms, 1e-12);
  EXPECT_LT(report["pixel_error"]["after"]["rms"],
            report["pixel_error"]["before"]["rms"]);
  EXPECT_TRUE(report["max_error"].is_null());
}

TEST_F(BundleAdjuster, HasNothingToAdjustWithoutPosesWhateverTheCap) {
  Model model = SmallLegacyModel();
  for (Frame& frame : model.frames) frame.rig_from_world.quaternion_wxyz = {};
  for (Image& image : model.images) image.cam_from_world.quaternion_wxyz = {};
  Save(model, folder_ / "input");
  for (const Words& cap :
       {Words{}, Words{"--BundleAdjustment.max_error", "minimum"}}) {
    const KrotResult result = Adjust(cap);
    EXPECT_EQ(result.exit_code, 3);
    EXPECT_THAT(result.err, HasSubstr("nothing to adjust: "));
  }
}

TEST_F(BundleAdjuster, ReportsItsCourse) {
  for (const Words& cap :
       {Words{}, Words{"--BundleAdjustment.max_error_factor", "1.1"}}) {
    Succeeded(Adjust(cap));
    const Json report = Report();
    const Json& iterations = report["iterations"];
    ASSERT_EQ(iterations.size(), report["num_iterations"]);
    ASSERT_FALSE(iterations.empty());
    const double end = iterations.back()["cost"];
    EXPECT_NEAR(end, report["cost_final"], 1e-9 * end);
    for (const Json& iteration : iterations) {
      EXPECT_EQ(iteration["barrier"].is_null(), cap.empty());
      EXPECT_TRUE(iteration["is_successful"].is_boolean());
      EXPECT_LE(iteration["seconds"], report["seconds"]["adjust"]);
    }
  }
}

TEST_F(BundleAdjuster, TakesNoMoreIterationsFarFromTheOrigin) {
  const auto num_iterations = [&](double distance) {
    Save(FarAway(SmallLegacyModel(), distance * Eigen::Vector3d(1, -1, 1)),
         folder_ / "input");
    Succeeded(Adjust({}));
    return Report()["num_iterations"].get<int>();
  };
  const int nearby = num_iterations(0);
  for (const double distance : {3e3, 3e4, 3e6}) {
    EXPECT_LE(num_iterations(distance), nearby + 2) << distance;
  }
}

TEST_F(BundleAdjuster, TellsOfItsPrecision) {
  const KrotResult result = Succeeded(Adjust({}));
  EXPECT_THAT(result.out, HasSubstr("px a posteriori, redundancy "));
  const Json report = Report();
  const Json& precision = report["precision"];
  const int64_t redundancy = precision["redundancy"];
  EXPECT_EQ(redundancy, 2 * report["num_observations"].get<int64_t>() -
                            report["num_parameters"].get<int64_t>() + 7);
  const double cost = report["cost_final"];
  EXPECT_NEAR(precision["sigma0"],
              std::sqrt(2 * cost / static_cast<double>(redundancy)),
              1e-9 * cost);
  EXPECT_NEAR(precision["largest_residuals"][0]["error"],
              report["pixel_error"]["after"]["max"], 1e-9);
  EXPECT_EQ(precision["images"].size(), report["num_images"]);
  EXPECT_TRUE(precision["images"][0]["covariance"][5][5].is_number());
  EXPECT_EQ(precision["cameras"][0]["params"][0], "f");
}

// Cameras side by side that look the same way: another focal length makes
// another depth, and the errors stay. Small turns would tell, if there were no
// noise.
Model SideBySide(double turn_rad, double noise_px) {
  Model model;
  model.cameras.push_back({7, 0, 1000, 800, {900, 500, 400}});
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> noise(0, noise_px);
  for (int n = 0; n < 4; ++n) {
    Image& image = model.images.emplace_back();
    image.id = n + 1;
    image.camera_id = 7;
    image.name = std::to_string(n) + ".jpg";
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(turn_rad * n, Eigen::Vector3d::UnitX()).matrix();
    const Eigen::Vector3d center(0.3 * n, 0.1 * (n % 2), 0);
    image.cam_from_world = ToPose({turn, -turn * center});
  }
  for (int k = 0; k < 60; ++k) {
    Point3D& point = model.points3D.emplace_back();
    point.id = k + 1;
    point.xyz = {uniform(random), uniform(random), 5 + uniform(random)};
    point.track_begin = model.track_elements.size();
    for (Image& image : model.images) {
      const auto pixel = ProjectPoint(
          model.cameras[0], image.cam_from_world.Transform() * point.xyz);
      model.track_elements.push_back(
          {image.id, static_cast<uint32_t>(image.points2D.size())});
      image.points2D.push_back(
          {pixel->x() + noise(random), pixel->y() + noise(random), point.id});
    }
    point.track_end = model.track_elements.size();
  }
  UseTrivialRigs(&model);
  model.stores_rigs = false;
  return model;
}

TEST_F(BundleAdjuster, WarnsOfAFocalLengthThatIsNotDetermined) {
  const Words as_it_is = {"--BundleAdjustment.max_num_iterations", "0"};
  const auto warning = [&](const Model& model) {
    Save(model, folder_ / "input");
    const KrotResult result = Succeeded(Adjust(as_it_is));
    EXPECT_EQ(Report()["warnings"].size(), 1u);
    const std::string words = Report()["warnings"].at(0);
    EXPECT_THAT(result.err, HasSubstr("warning: " + words + "\n"));
    return words;
  };
  const std::string what = "camera 7: the observations do not determine ";
  EXPECT_THAT(warning(SideBySide(3e-4, 0.5)),
              AllOf(HasSubstr(what + "f, which is 900 +- "),
                    HasSubstr("--BundleAdjustment.refine_focal_length 0")));
  EXPECT_THAT(warning(SideBySide(0, 1e-3)), HasSubstr(what));
  Succeeded(Adjust({"--BundleAdjustment.refine_focal_length", "0"}));
  EXPECT_TRUE(Report()["warnings"].empty());
  // Far larger turns determine it.
  Save(SideBySide(0.1, 0.5), folder_ / "input");
  Succeeded(Adjust({}));
  EXPECT_TRUE(Report()["warnings"].empty());
}

TEST_F(BundleAdjuster, WarnsOfAnEndAtTheLimitFarFromAMinimum) {
  Model model = Load(folder_ / "input");
  for (Point3D& point : model.points3D) point.xyz.x() += 0.05;
  Save(model, folder_ / "input");
  const Words few = {"--BundleAdjustment.max_num_iterations", "1"};
  const KrotResult result = Succeeded(Adjust(few));
  EXPECT_THAT(result.err, HasSubstr("warning: the adjustment ended at the "
                                    "limit of iterations, far from a minimum"));
  EXPECT_THAT(result.err,
              HasSubstr("allow more (--BundleAdjustmentCeres.max_num_"));
  Succeeded(Adjust({}));
  EXPECT_TRUE(Report()["warnings"].empty());
  // Nothing is left to gain where it ended.
  Save(Load(folder_ / "output"), folder_ / "input");
  Succeeded(Adjust(few));
  EXPECT_TRUE(Report()["warnings"].empty());
}

TEST_F(BundleAdjuster, WritesAProtocolWhereTheReportIsText) {
  std::ofstream(folder_ / "gps.txt")
      << Load(folder_ / "input").images[0].name << " 1 2 3 9\n";
  Succeeded(RunKrot({"bundle_adjuster", "--input_path", folder_ / "input",
                     "--output_path", folder_ / "output", "--report_path",
                     folder_ / "report.txt", "--BundleAdjustment.datum",
                     "POINTS", "--positions_path", folder_ / "gps.txt"}));
  const std::string text = ReadBytes(folder_ / "report.txt");
  for (const char* part :
       {"sigma0 a posteriori, px", "largest residual: point3D_id ",
        "inner constraints over all object points", "Interior orientation",
        "Exterior orientation", "Reliability", "Rays per object point",
        "Known positions, in their frame",
        "Object points; RMS of the standard deviations"}) {
    EXPECT_THAT(text, HasSubstr(part));
  }
}

// The survey is the adjusted model turned, moved and 3 times as large; one
// point of it is off by 0.3.
TEST_F(BundleAdjuster, ComparesCheckPointsWithTheirSurvey) {
  Succeeded(Adjust({}));
  const Model model = Load(folder_ / "output");
  std::ofstream file(folder_ / "survey.txt");
  file.precision(17);
  for (size_t k = 0; k < 40; ++k) {
    const Eigen::Vector3d& x = model.points3D[k].xyz;
    file << model.points3D[k].id << ' ' << 100 - 3 * x.y() << ' '
         << 3 * x.x() - 50 << ' ' << 3 * x.z() + (k == 7 ? 0.3 : 0) << '\n';
  }
  file.close();
  const Words check = {"--check_points_path", folder_ / "survey.txt"};
  Succeeded(Adjust(check));
  const Json points = Report()["check_points"];
  EXPECT_NEAR(points["scale"], 3, 0.05);
  ASSERT_EQ(points["points"].size(), 40);
  EXPECT_EQ(points["points"][7]["point3D_id"], model.points3D[7].id);
  EXPECT_NEAR(points["points"][7]["difference"][2], -0.3, 0.06);
  EXPECT_GT(points["rms"], 0.3 / std::sqrt(40.0) / 2);
  EXPECT_LT(points["rms"], 0.3 / std::sqrt(40.0));
}

// A unit of the model is 2.5 m by three scale bars; a fourth is 10 % too long,
// and a length is only asked for.
TEST_F(BundleAdjuster, TakesScaleBarsAsObservations) {
  Succeeded(Adjust({}));
  const Model model = Load(folder_ / "output");
  const auto write = [&](const std::vector<double>& factors) {
    std::ofstream file(folder_ / "bars.txt");
    file.precision(17);
    for (size_t n = 0; n < factors.size(); ++n) {
      const Point3D& a = model.points3D[2 * n];
      const Point3D& b = model.points3D[2 * n + 1];
      file << a.id << ' ' << b.id;
      if (factors[n] > 0) {
        file << ' ' << factors[n] * (a.xyz - b.xyz).norm() << " 0.01";
      }
      file << '\n';
    }
  };
  write({2.5, 2.5, 2.5, 2.75, 0});
  const Words bars = {"--distances_path", folder_ / "bars.txt"};
  const KrotResult result = Succeeded(Adjust(bars));
  EXPECT_THAT(result.out, HasSubstr("metres: 3 known ones took part"));
  const Json report = Report();
  const Json& distances = report["distances"];
  EXPECT_NEAR(distances["metres_per_unit"], 2.5, 0.05);
  EXPECT_EQ(report["precision"]["datum_defect"], 6);
  const Model output = Load(folder_ / "output");
  for (size_t n = 0; n < 5; ++n) {
    const Json& bar = distances["distances"][n];
    EXPECT_EQ(bar["takes_part"], n < 3);
    EXPECT_EQ(bar["is_contradicted"], n == 3);
    EXPECT_NEAR(
        bar["after"],
        (output.points3D[2 * n].xyz - output.points3D[2 * n + 1].xyz).norm(),
        1e-9);
    EXPECT_GT(bar["sigma"], 0);
    EXPECT_EQ(bar["w"].is_number(), n < 3);
    if (n < 3) {
      EXPECT_NEAR(bar["after"], bar["metres"], 0.01);
    }
  }

  write({2.5, 2.75});
  const KrotResult undecided = Adjust(bars);
  EXPECT_EQ(undecided.exit_code, 2);
  EXPECT_THAT(undecided.err, HasSubstr("distances: found 2 distances "
                                       "that contradict"));
  EXPECT_EQ(Adjust({"--distances_path", folder_ / "bars.txt",
                    "--BundleAdjustment.max_error", "9"})
                .exit_code,
            1);
}

// GPS in a frame of its own, 3 times as large, with standard deviations of
// 0.02, one of them wrong by 5: the model comes to that frame, and check points
// are compared there.
TEST_F(BundleAdjuster, TakesKnownPositionsAsObservations) {
  const Model model = Load(folder_ / "input");
  const auto surveyed = [](const Eigen::Vector3d& x) {
    return Eigen::Vector3d(100 - 3 * x.y(), 3 * x.x() - 50, 3 * x.z());
  };
  std::ofstream gps(folder_ / "gps.txt"), check(folder_ / "check.txt");
  gps.precision(17);
  check.precision(17);
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  for (size_t n = 0; n < images.size(); ++n) {
    const double error = n == 1 ? 5 : 0.01 * static_cast<double>(n % 3);
    gps << model.images[n].name << ' '
        << (surveyed(Center(images[n].cam_from_world)) +
            Eigen::Vector3d(error, 0, 0))
               .transpose()
        << " 0.06\n";
  }
  for (size_t k = 0; k < 2; ++k) {  // too few to fit to
    check << model.points3D[k].id << ' '
          << surveyed(model.points3D[k].xyz).transpose() << '\n';
  }
  gps.close();
  check.close();
  // In metres, whichever frame the adjustment is done in.
  std::ofstream(folder_ / "bar.txt")
      << model.images[0].name << ' ' << model.images[2].name << ' '
      << 3 * LengthsOf(model, {{{{{true, 0}, {true, 2}}}, {}, 0}})[0]
      << " 0.06\n";
  for (const std::string frame : {"own", "model"}) {
    const KrotResult result = Succeeded(Adjust(
        {"--positions_path", folder_ / "gps.txt", "--positions_frame", "own",
         "--output_frame", frame, "--check_points_path", folder_ / "check.txt",
         "--distances_path", folder_ / "bar.txt"}));
    EXPECT_THAT(result.err,
                HasSubstr("the position of " + model.images[1].name));
    EXPECT_THAT(result.out, HasSubstr("known positions took part"));
    const Json report = Report();
    const Json& positions = report["positions"];
    ASSERT_EQ(positions["points"].size(), images.size() - 1);
    EXPECT_LT(positions["rms"], 0.05);
    EXPECT_GT(positions["sigma_px"], 0);
    EXPECT_NEAR(positions["frame"]["scale"], 3, 0.1);
    EXPECT_EQ(positions["frame"]["is_written"], frame == "own");
    EXPECT_EQ(report["precision"]["datum_defect"], 0);
    EXPECT_LT(report["check_points"]["rms"], 0.3);
    EXPECT_TRUE(report["distances"]["metres_per_unit"].is_null());
    const Json& bar = report["distances"]["distances"][0];
    EXPECT_TRUE(bar["takes_part"]);
    EXPECT_NEAR(bar["after"], bar["metres"], 0.06);
    const Model output = Load(folder_ / "output");
    const Eigen::Vector3d written =
        Center(ImageGeometries(output)[0].cam_from_world);
    const Eigen::Vector3d before = Center(images[0].cam_from_world);
    EXPECT_LT((written - (frame == "own" ? surveyed(before) : before)).norm(),
              0.1);
  }
}

// The noise that positions weigh beside is found in several adjustments.
TEST_F(BundleAdjuster, TakesNoMoreIterationsThanAllowedWithKnownPositions) {
  const Model model = Load(folder_ / "input");
  std::ofstream(folder_ / "gps.txt") << model.images[0].name << " 1 2 3 9\n";
  for (const int most : {0, 1, 4}) {
    Succeeded(Adjust({"--positions_path", folder_ / "gps.txt",
                      "--BundleAdjustment.max_num_iterations",
                      std::to_string(most)}));
    EXPECT_LE(Report()["num_iterations"], most);
    EXPECT_EQ(Report()["iterations"].size(), Report()["num_iterations"]);
  }
}

TEST_F(BundleAdjuster, SaysThatNoKnownPositionTookPart) {
  const std::string held = Load(folder_ / "input").images[0].name;
  std::ofstream(folder_ / "held.txt") << held << '\n';
  std::ofstream(folder_ / "gps.txt") << held << " 1 2 3 1000\n";
  const KrotResult result =
      Succeeded(Adjust({"--positions_path", folder_ / "gps.txt",
                        "--fixed_images_path", folder_ / "held.txt"}));
  EXPECT_THAT(result.out, HasSubstr("No known position took part"));
}

TEST_F(BundleAdjuster, RefusesKnownPositionsWithACap) {
  std::ofstream(folder_ / "gps.txt") << "a.jpg 1 2 3 1\n";
  const KrotResult result = Adjust({"--positions_path", folder_ / "gps.txt",
                                    "--BundleAdjustment.max_error", "5"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.err, HasSubstr("--positions_path"));
  EXPECT_THAT(result.err, HasSubstr("with a cap"));
}

TEST_F(BundleAdjuster, RefusesCheckPointsThatAreTooFew) {
  const Model model = Load(folder_ / "input");
  std::ofstream(folder_ / "survey.txt") << model.points3D[0].id << " 1 2 3\n"
                                        << model.points3D[1].id << " 2 3 4\n";
  const KrotResult result =
      Adjust({"--check_points_path", folder_ / "survey.txt"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err,
              HasSubstr("found 2 check points of the model, expected "
                        "three or more that are not on a line"));
}

TEST_F(BundleAdjuster, AgreesWithColmap) {
  if (!HasColmap()) GTEST_SKIP() << "no colmap";
  Succeeded(Adjust({}));
  const double ours = Report()["cost_final"];
  std::filesystem::create_directory(folder_ / "colmap");
  ASSERT_TRUE(RunColmap({"bundle_adjuster", "--input_path", folder_ / "input",
                         "--output_path", folder_ / "colmap"},
                        folder_ / "log"));
  const PixelErrorStatistics theirs =
      Summarize(PixelErrors(Load(folder_ / "colmap")));
  const double cost =
      theirs.rms * theirs.rms / 2 * static_cast<double>(theirs.count);
  EXPECT_NEAR(ours, cost, 1e-3 * cost);
}

TEST_F(BundleAdjuster, StaysBelowACapThatIsAFactor) {
  Succeeded(Adjust({"--BundleAdjustment.max_error_factor", "1.1"}));
  const Json report = Report();
  EXPECT_EQ(report["termination"], "cap_converged");
  // Of the lowest maximum, not of the start, whose largest error the finish has
  // raised to the cap, nearly.
  const double lowest = report["max_error"].get<double>() / 1.1;
  EXPECT_GE(lowest, report["start_lower_bound"]);
  EXPECT_LE(lowest, 1.0002 * report["start_lower_bound"].get<double>());
  EXPECT_LT(report["pixel_error"]["start"]["max"], report["max_error"]);
  const PixelErrorStatistics errors =
      Summarize(PixelErrors(Load(folder_ / "output")));
  EXPECT_LT(errors.max, report["max_error"]);
}

TEST_F(BundleAdjuster, CallsNothingALocalMinimumWhereTheSearchEndedEarly) {
  const KrotResult result =
      Succeeded(Adjust({"--BundleAdjustment.max_error", "minimum",
                        "--BundleAdjustmentCeres.max_num_iterations", "5"}));
  EXPECT_THAT(result.out, HasSubstr("a lower one may well exist"));
  EXPECT_THAT(result.out, Not(HasSubstr("minimum")));
  EXPECT_THAT(result.out, Not(HasSubstr("which holds")));
  EXPECT_EQ(Report()["is_lowest_max_error_converged"], false);
}

TEST_F(BundleAdjuster, LowersTheLargestErrorWithAllThatMoves) {
  const KrotResult result =
      Succeeded(Adjust({"--BundleAdjustment.max_error", "minimum"}));
  EXPECT_THAT(result.out, HasSubstr("a local minimum, nearly"));
  EXPECT_THAT(result.err, HasSubstr(" px, barrier "));
  const Json report = Report();
  EXPECT_EQ(report["termination"], "cap_converged");
  EXPECT_EQ(report["is_lowest_max_error_converged"], true);
  const double max = Summarize(PixelErrors(Load(folder_ / "output"))).max;
  EXPECT_GE(report["max_error"], report["lowest_max_error"]);
  EXPECT_LE(report["max_error"],
            1.0005001 * report["lowest_max_error"].get<double>());
  EXPECT_LT(max, report["max_error"]);
  EXPECT_LT(max, report["start_lower_bound"]);
}

TEST_F(BundleAdjuster, StartsJustBelowACapInPixels) {
  Succeeded(Adjust({"--BundleAdjustment.max_error_factor", "1.01"}));
  const double lowest = Report()["start_lower_bound"];
  for (const double factor : {1.0003, 1.05}) {
    Succeeded(Adjust(
        {"--BundleAdjustment.max_error", std::to_string(factor * lowest)}));
    EXPECT_LT(Report()["pixel_error"]["start"]["max"], factor * lowest);
    EXPECT_LT(Report()["pixel_error"]["after"]["max"], factor * lowest);
  }
}

TEST_F(BundleAdjuster, TellsOfTheSolveThatItsCapRefersTo) {
  const KrotResult result =
      Succeeded(Adjust({"--BundleAdjustment.max_error_factor", "1.1"}));
  const size_t sweep = result.err.find("\nsweep 1: cost ");
  const size_t joint = result.err.find("\niteration 1: cost ");
  const size_t adjustment = result.err.find("barrier ");
  EXPECT_LT(sweep, joint);
  EXPECT_LT(joint, adjustment);
  EXPECT_LT(adjustment, result.err.size());
}

TEST_F(BundleAdjuster, SaysWhichBoundForbidsACap) {
  EXPECT_THAT(
      Adjust({"--BundleAdjustment.max_error", "0.01", "--log_level", "0"}),
      IsRefused(7, "krot bundle_adjuster", "it is proved that none is below"));
  EXPECT_EQ(FileNames(folder_.path()), (Words{"input"}));
}

TEST_F(BundleAdjuster, HasNothingToAdjustWhereAllIsHeldStill) {
  EXPECT_THAT(Adjust({"--BundleAdjustment.refine_extrinsics", "0",
                      "--BundleAdjustment.refine_points3D", "0",
                      "--BundleAdjustment.refine_focal_length", "0",
                      "--BundleAdjustment.refine_extra_params", "0"}),
              IsRefused(3, "krot bundle_adjuster", "everything is held still"));
}

TEST_F(BundleAdjuster, RefusesOptionsOutOfRangeAndThatContradictEachOther) {
  const std::string cap = "--BundleAdjustment.max_error";
  const std::string ceres = "--BundleAdjustmentCeres.";
  const std::vector<std::pair<Words, std::string>> wrong = {
      {{cap, "0"}, "must be a number > 0, pixels, or minimum"},
      {{cap, "minimum", cap + "_factor", "2"}, "are the same; give one"},
      {{cap, "minimum", ceres + "loss_function_type", "HUBER"}, "TRIVIAL"},
      {{cap + "_factor", "1"}, "must be a number > 1"},
      {{cap, "3", cap + "_factor", "2"}, "are the same; give one"},
      {{cap, "3", ceres + "loss_function_type", "HUBER"}, "TRIVIAL"},
      {{ceres + "loss_function_type", "TUKEY"}, "must be one of"},
      {{ceres + "loss_function_scale", "2"}, "has no effect"},
      {{ceres + "max_num_iterations", "3",
        "--BundleAdjustment.max_num_iterations", "3"},
       "are the same; give one"},
      {{"--BundleAdjustment.refine_extrinsics", "0",
        "--BundleAdjustment.refine_rig_from_world", "0"},
       "are the same; give one"},
      {{"--BundleAdjustment.refine_rig_from_world", "0",
        "--BundleAdjustment.constant_rig_from_world_rotation", "1"},
       "has no effect"},
      {{"--BundleAdjustment.min_track_length", "0"}, "must be"},
      {{ceres + "num_threads", "0"}, "must be"},
  };
  for (const auto& [options, part] : wrong) {
    SCOPED_TRACE(options[0]);
    EXPECT_THAT(Adjust(options), IsRefused(1, "krot bundle_adjuster", part));
  }
  EXPECT_EQ(FileNames(folder_.path()), (Words{"input"}));
}

TEST_F(BundleAdjuster, PolishesWhatTheSolverFound) {
  for (const char* kind : {"rotations_fixed", "full"}) {
    const KrotResult result = Succeeded(
        RunKrot({"solver", "--input_path", folder_ / "input", "--output_path",
                 folder_ / "output", "--overwrite", "1", "--report_path",
                 folder_ / "report.json", "--Solver.polish", kind}));
    EXPECT_THAT(result.out, HasSubstr("polished"));
    const Json report = Report();
    const PixelErrorStatistics errors =
        Summarize(PixelErrors(Load(folder_ / "output")));
    EXPECT_EQ(report["polish"]["polish"], kind);
    EXPECT_NEAR(report["polish"]["pixel_error"]["rms"], errors.rms, 1e-12);
    EXPECT_LT(errors.rms, report["pixel_error"]["after"]["rms"]);
    EXPECT_GT(errors.max, report["lower_bound"]);
  }
}

}  // namespace
}  // namespace krot::internal
