#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/model/rigs.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"
#include "tests/testing/scene_of.h"

// The commands on models that they can solve.

namespace krot::internal {
namespace {

Words Keys(const Json& json) {
  Words keys;
  for (const auto& item : json.items()) keys.push_back(item.key());
  return keys;
}

class Commands : public ::testing::Test {
 protected:
  KrotResult Run(const std::string& command, Words more = {}) const {
    return RunKrot(
        {command, "--input_path", folder_ / "input", "--output_path",
         folder_ / "output", "--report_path", folder_ / "report.json"},
        more);
  }
  Json Report() const { return ReadJson(folder_ / "report.json"); }

  TempFolder folder_;
};

constexpr Ignoring kWhatASolveChanges = {true, true, true};

TEST_F(Commands, SolverLowersTheCostAndKeepsEverythingElse) {
  for (const int sensors_per_rig : {1, 2}) {
    SceneOptions options = SmallScene();
    options.sensors_per_rig = sensors_per_rig;
    const Model before = SynthesizeScene(options).model;
    Save(before, folder_ / "input");
    Succeeded(Run("solver", {"--overwrite", "1"}));

    const Model after = Load(folder_ / "output");
    EXPECT_THAT(after, IsModel(before, kWhatASolveChanges));
    const Json report = Report();
    EXPECT_LT(report["cost_final"], 0.9 * report["cost_initial"].get<double>());
    EXPECT_EQ(report["termination"], "gap_reached");
    EXPECT_EQ(report["pixel_error"]["before"]["max"],
              Summarize(PixelErrors(before)).max);
    EXPECT_EQ(report["pixel_error"]["after"]["max"],
              Summarize(PixelErrors(after)).max);
  }
}

TEST_F(Commands, SolverStoresTheMeanPixelErrorOfEveryPoint) {
  Save(SmallLegacyModel(), folder_ / "input");
  Succeeded(Run("solver"));
  const Model after = Load(folder_ / "output");
  const std::vector<double> errors_px = PixelErrors(after);
  for (const Point3D& point : after.points3D) {
    double sum = 0;
    for (uint64_t n = point.track_begin; n < point.track_end; ++n) {
      sum += errors_px[n];
    }
    const double length =
        static_cast<double>(point.track_end - point.track_begin);
    EXPECT_NEAR(point.error, sum / length, 1e-12);
  }
}

TEST_F(Commands, SolverGivesTheSameBytesAtAnyNumberOfThreads) {
  SceneOptions options = SmallScene();
  options.num_points = 2000;
  Save(SynthesizeScene(options).model, folder_ / "input");
  for (const char* method : {"auto", "res_int"}) {
    Words images;
    Words points;
    for (const char* threads : {"1", "2", "3", "-1"}) {
      Succeeded(Run("solver", {"--Solver.num_threads", threads, "--overwrite",
                               "1", "--Solver.method", method}));
      images.push_back(ReadBytes(folder_ / "output/images.bin"));
      points.push_back(ReadBytes(folder_ / "output/points3D.bin"));
    }
    EXPECT_THAT(images, ::testing::Each(images.front()));
    EXPECT_THAT(points, ::testing::Each(points.front()));
  }
}

TEST_F(Commands, SolverReportsEveryKeyOfItsContract) {
  Save(SmallLegacyModel(), folder_ / "input");
  Succeeded(Run("solver", {"--random_seed", "7", "--Solver.num_threads", "2",
                           "--Solver.norm", "inf"}));
  const Json report = Report();
  EXPECT_THAT(
      Keys(report),
      ::testing::UnorderedElementsAre(
          "version", "command", "method", "norm", "termination", "num_frames",
          "num_images", "num_points", "num_observations",
          "working_observations", "left_out", "cost_initial", "cost_final",
          "lower_bound", "relative_gap", "certified", "pixel_error", "polish",
          "sweeps", "iterations", "support", "seconds", "peak_memory_bytes",
          "threads", "seed", "rounds", "linear_cost", "linear_lower_bound",
          "linear_relative_gap", "is_given_back", "contradictions", "finish",
          "same_image", "outliers", "rotations", "fixed", "positions",
          "support_positions", "at_folds", "poses", "not_held",
          "announced_memory_bytes", "verdict", "collapse", "is_underdetermined",
          "matches", "distances"));
  EXPECT_THAT(Keys(report["finish"]),
              ::testing::UnorderedElementsAre(
                  "finish", "loss", "termination", "cap", "lowest_cost",
                  "cost_initial", "cost_final", "duality_gap", "stationarity",
                  "num_active", "num_iterations", "seconds"));
  EXPECT_EQ(Keys(report["left_out"]),
            (Words{"behind", "fixed", "no_pose", "same_image", "short_track",
                   "undistortion"}));
  EXPECT_EQ(Keys(report["pixel_error"]), (Words{"after", "before"}));
  EXPECT_EQ(Keys(report["pixel_error"]["after"]),
            (Words{"max", "mean", "p99", "rms"}));
  EXPECT_EQ(Keys(report["seconds"]),
            (Words{"build", "certify", "read", "solve", "total", "write"}));
  ASSERT_FALSE(report["sweeps"].empty());
  EXPECT_EQ(Keys(report["sweeps"][0]), (Words{"cost", "seconds"}));
  EXPECT_EQ(report["version"], KROT_VERSION);
  EXPECT_EQ(report["command"], "solver");
  EXPECT_EQ(report["method"], "auto");
  EXPECT_EQ(report["norm"], "inf");
  EXPECT_EQ(report["certified"], true);
  EXPECT_LE(report["relative_gap"], 5e-4);
  EXPECT_EQ(report["relative_gap"].get<double>(),
            (report["cost_final"].get<double>() -
             report["lower_bound"].get<double>()) /
                report["cost_final"].get<double>());
  ASSERT_FALSE(report["iterations"].empty());
  EXPECT_EQ(
      Keys(report["iterations"][0]),
      (Words{"cost", "gap", "lower_bound", "method", "seconds", "target"}));
  EXPECT_GT(report["working_observations"], 0);
  EXPECT_LE(report["working_observations"], report["num_observations"]);
  ASSERT_FALSE(report["support"].empty());
  EXPECT_EQ(Keys(report["support"][0]),
            (Words{"error_px", "image_id", "image_name", "multiplier",
                   "point2D_idx", "point3D_id"}));
  EXPECT_EQ(report["num_images"], 6);
  EXPECT_EQ(report["num_points"], 60);
  EXPECT_EQ(report["threads"], 2);
  EXPECT_EQ(report["seed"], 7);
  EXPECT_GT(report["peak_memory_bytes"], 1000000);
}

TEST_F(Commands, SolverSaysNullForWhatSweepsAloneDoNotKnow) {
  Save(SmallLegacyModel(), folder_ / "input");
  Succeeded(Run("solver", {"--Solver.method", "res_int"}));
  const Json report = Report();
  EXPECT_EQ(report["method"], "res_int");
  EXPECT_EQ(report["termination"], "stalled");
  EXPECT_TRUE(report["lower_bound"].is_null());
  EXPECT_TRUE(report["relative_gap"].is_null());
  EXPECT_TRUE(report["seconds"]["certify"].is_null());
  EXPECT_EQ(report["certified"], false);
  EXPECT_EQ(report["iterations"], Json::array());
  EXPECT_EQ(report["support"], Json::array());
}

TEST_F(Commands, SolverWritesACertificateThatCheckerAndAnalyzerAccept) {
  Save(SmallLegacyModel(), folder_ / "input");
  const std::string certificate = folder_ / "certificate.json";
  const KrotResult solve =
      Succeeded(Run("solver", {"--certificate_path", certificate}));
  EXPECT_THAT(solve.out, HasSubstr(", proved to be within "));
  // Of the model that was read as well as of the one that was written.
  for (const char* model : {"input", "output"}) {
    const KrotResult check = Succeeded(
        RunKrot({"certificate_checker", "--input_path", folder_ / model,
                 "--certificate_path", certificate, "--num_worst", "1",
                 "--report_path", folder_ / "check.json"}));
    const Json report = ReadJson(folder_ / "check.json");
    EXPECT_EQ(report["command"], "certificate_checker");
    EXPECT_GT(report["certificate"]["lower_bound"], 0);
    EXPECT_LE(report["certificate"]["lower_bound"],
              report["certificate"]["cost"]);
    EXPECT_TRUE(report["conflicts"].is_null());
    EXPECT_THAT(check.out, HasSubstr("worst first; the first 1\n"));
  }
  const KrotResult analysis =
      Succeeded(RunKrot({"model_analyzer", "--path", folder_ / "output",
                         "--certificate_path", certificate}));
  EXPECT_THAT(analysis.out, HasSubstr("\nPoints: 60\n"));
  EXPECT_THAT(analysis.out, HasSubstr("The certificate holds"));
  EXPECT_THAT(analysis.out, HasSubstr("worst first"));

  Save(SynthesizeScene(SmallScene()).model, folder_ / "other");
  EXPECT_THAT(RunKrot({"model_analyzer", "--path", folder_ / "other",
                       "--certificate_path", certificate}),
              IsRefused(4, "krot model_analyzer", "refused"));
}

TEST_F(Commands, SolverWarnsOfAGapThatIsMissed) {
  Save(SmallLegacyModel(), folder_ / "input");
  const KrotResult result = Succeeded(
      Run("solver", {"--Joint.max_iterations", "2", "--certificate_path",
                     folder_ / "certificate.json"}));
  EXPECT_THAT(result.err,
              HasSubstr("warning: the gap asked for is not reached: "
                        "Joint.max_iterations was hit"));
  EXPECT_THAT(result.err, HasSubstr("is not written"));
  EXPECT_EQ(Report()["termination"], "max_iterations");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "certificate.json"));
}

TEST_F(Commands, SolverWarnsOfErrorsOfZeroThatSayNothing) {
  SceneOptions options = SmallScene();
  options.num_frames = 2;
  options.num_points = 2;
  options.track_length = 2;
  Save(SynthesizeScene(options).model, folder_ / "input");
  const KrotResult result = Succeeded(Run("solver"));
  EXPECT_THAT(result.err,
              HasSubstr("warning: errors of zero say nothing: 4 "
                        "observations are too few to determine 2 frames "
                        "and 2 points"));
  EXPECT_EQ(Report()["is_underdetermined"], true);
}

TEST_F(Commands, SolverNeedsNoTranslations) {
  for (const bool has_rigs : {true, false}) {
    SceneOptions options = SmallScene();
    options.has_rigs = has_rigs;
    const Model model = SynthesizeScene(options).model;
    Save(model, folder_ / "input");
    Succeeded(Run("solver", {"--overwrite", "1"}));
    const double cost = Report()["cost_final"];
    Save(WithoutTranslations(model), folder_ / "input");
    for (const char* init : {"model", "feasible"}) {
      Succeeded(Run("solver", {"--Solver.init", init, "--overwrite", "1",
                               "--certificate_path", folder_ / "proof.json"}));
      EXPECT_EQ(Report()["certified"], true);
      EXPECT_EQ(Report()["num_observations"], model.track_elements.size());
      EXPECT_NEAR(Report()["cost_final"], cost, 2e-4 * cost);
      EXPECT_NO_THROW(Load(folder_ / "output"));
    }
  }
}

TEST_F(Commands, SolverFromNothingTakesItsBoundFromTheNoise) {
  const Model model = SynthesizeScene(SmallScene()).model;
  Save(WithoutTranslations(model), folder_ / "input");
  Succeeded(Run("solver", {"--overwrite", "1"}));
  const double cost = Report()["cost_final"];
  const KrotResult within = Succeeded(
      Run("solver", {"--Solver.init", "feasible", "--overwrite", "1"}));
  EXPECT_EQ(Report()["termination"], "within_bound");
  EXPECT_EQ(Report()["num_observations"], model.track_elements.size());
  EXPECT_GT(Report()["cost_final"], cost);
  EXPECT_THAT(within.out, HasSubstr("removed 0 of"));
}

TEST_F(Commands, SolverProvesThatNoStartIsBelowABound) {
  Save(SmallLegacyModel(), folder_ / "input");
  const std::string certificate = folder_ / "certificate.json";
  EXPECT_THAT(
      Run("solver",
          {"--Solver.init", "feasible", "--Problem.init_max_error", "0.1",
           "--certificate_path", certificate, "--log_level", "0"}),
      IsRefused(7, "krot solver",
                "infeasible: the largest error of every estimate "
                "is proved to be at least "));
  EXPECT_EQ(FileNames(folder_.path()), (Words{"certificate.json", "input"}));
  Succeeded(RunKrot({"certificate_checker", "--input_path", folder_ / "input",
                     "--certificate_path", certificate}));
}

TEST_F(Commands, SolverCountsWhatItLeavesOut) {
  Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  Succeeded(Run("solver", {"--Problem.min_track_length", "4"}));
  int64_t num_short = 0;
  for (const Point3D& point : model.points3D) {
    const uint64_t length = point.track_end - point.track_begin;
    if (length < 4) num_short += static_cast<int64_t>(length);
  }
  ASSERT_GT(num_short, 0);
  EXPECT_EQ(Report()["left_out"]["short_track"], num_short);
  EXPECT_EQ(Report()["num_observations"],
            static_cast<int64_t>(model.track_elements.size()) - num_short);
}

TEST_F(Commands, SolverMeasuresItsCostInTheNormAskedFor) {
  Save(SmallLegacyModel(), folder_ / "input");
  std::vector<double> costs;
  for (const char* norm : {"1", "1.5", "2", "inf"}) {
    Succeeded(Run("solver", {"--overwrite", "1", "--Solver.norm", norm}));
    EXPECT_EQ(Report()["norm"], norm);
    EXPECT_LT(Report()["cost_final"], Report()["cost_initial"]);
    costs.push_back(Report()["cost_initial"]);
  }
  EXPECT_TRUE(std::is_sorted(costs.rbegin(), costs.rend()));
}

TEST_F(Commands, SolverStopsWhereThePaperDoesWithItsSettings) {
  Save(SmallLegacyModel(), folder_ / "input");
  Succeeded(Run("solver", {"--Solver.settings", "paper"}));
  const Json sweeps = Report()["sweeps"];
  ASSERT_GE(sweeps.size(), 2u);
  double last = Report()["cost_initial"];
  for (size_t i = 0; i < sweeps.size(); ++i) {
    const double cost = sweeps[i]["cost"];
    EXPECT_EQ((last - cost) < 1e-3 * last, i + 1 == sweeps.size());
    last = cost;
  }
}

TEST_F(Commands, SolverRunsAsManySweepsAsAllowed) {
  Save(SmallLegacyModel(), folder_ / "input");
  Succeeded(
      Run("solver", {"--ResInt.max_sweeps", "2", "--ResInt.sweep_tolerance",
                     "0", "--Solver.method", "res_int"}));
  EXPECT_EQ(Report()["termination"], "max_sweeps");
  EXPECT_EQ(Report()["sweeps"].size(), 2u);
}

TEST_F(Commands, PointTriangulatorMovesPointsOnly) {
  const Model before = SmallLegacyModel();
  Save(before, folder_ / "input");
  Succeeded(Run("point_triangulator"));
  Ignoring points_only;
  points_only.coordinates = true;
  points_only.point_errors = true;
  EXPECT_THAT(Load(folder_ / "output"), IsModel(before, points_only));
  EXPECT_EQ(Report()["command"], "point_triangulator");
  EXPECT_EQ(Report()["method"], "intersection");
  EXPECT_EQ(Report()["sweeps"].size(), Report()["rounds"].size());
  EXPECT_LT(Report()["cost_final"], Report()["cost_initial"]);
}

TEST_F(Commands, ModelAnalyzerListsTheWorstObservations) {
  const Model model = SmallLegacyModel();
  Save(model, folder_ / "input");
  const KrotResult result = Succeeded(
      RunKrot({"model_analyzer", "--path", folder_ / "input", "--num_worst",
               "3", "--report_path", folder_ / "report.json"}));
  EXPECT_THAT(result.out, HasSubstr("\nPoints: 60\n"));
  EXPECT_THAT(result.out, HasSubstr("the 3 of 6 with the largest"));
  const Json report = Report();
  ASSERT_EQ(report["worst"].size(), 3u);
  EXPECT_EQ(report["worst"][0]["error_px"], Summarize(PixelErrors(model)).max);
  EXPECT_EQ(report["worst"][0]["error_px"], report["pixel_error"]["max"]);
  EXPECT_EQ(report["images"].size(), 6u);
  EXPECT_EQ(report["colmap"]["num_observations"], model.track_elements.size());
  EXPECT_EQ(RunKrot({"model_analyzer", "--input_path", folder_ / "input",
                     "--num_worst", "3"})
                .out,
            result.out);
}

// However many cameras there are, the terminal gets the worst; a file gets all.
TEST_F(Commands, ModelAnalyzerListsTheWorstOfManyCameras) {
  SceneOptions options = SmallScene();
  options.has_rigs = false;
  options.num_frames = 30;
  Model model = SynthesizeScene(options).model;
  const Camera camera = model.cameras.front();
  model.cameras.clear();
  for (Image& image : model.images) {
    image.camera_id = image.id + 100;
    model.cameras.push_back(camera);
    model.cameras.back().id = image.camera_id;
  }
  UseTrivialRigs(&model);
  Save(model, folder_ / "input");
  const KrotResult result = Succeeded(
      RunKrot({"model_analyzer", "--path", folder_ / "input", "--report_path",
               folder_ / "report.json", "--csv_path", folder_ / "errors.csv"}));
  const size_t begin = result.out.find("By camera, pixels; the 10 of 30 with");
  const size_t end = result.out.find("\nBy image");
  ASSERT_NE(begin, std::string::npos) << result.out;
  const std::string cameras = result.out.substr(begin, end - begin);
  EXPECT_EQ(std::count(cameras.begin(), cameras.end(), '\n'), 2 + 10);

  std::istringstream csv(ReadBytes(folder_ / "errors.csv"));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line,
            "image_id,image_name,camera_id,num_images,num_observations,"
            "num_not_finite,max_px,p99_px,mean_px,rms_px");
  const Json report = Report();
  for (const Json& expected : report["cameras"]) {
    ASSERT_TRUE(std::getline(csv, line));
    const std::string id = std::to_string(expected["camera_id"].get<int>());
    EXPECT_THAT(line, ::testing::StartsWith(",," + id + ",1,"));
    EXPECT_NEAR(std::stod(line.substr(line.rfind(',') + 1)),
                expected["pixel_error"]["rms"], 1e-8);
    const bool is_listed = cameras.find("\n  " + id + ",") != std::string::npos;
    const auto num_worse = std::count_if(
        report["cameras"].begin(), report["cameras"].end(),
        [&](const Json& other) {
          return other["pixel_error"]["max"] > expected["pixel_error"]["max"];
        });
    EXPECT_EQ(is_listed, num_worse < 10);
  }
  for (const Json& expected : report["images"]) {
    ASSERT_TRUE(std::getline(csv, line));
    EXPECT_THAT(line, HasSubstr(expected["image_name"]));
  }
  EXPECT_FALSE(std::getline(csv, line));
}

TEST_F(Commands, ModelAnalyzerTakesAModelWithoutPoints) {
  Save(WithShortTracks(SmallLegacyModel(), 0), folder_ / "input");
  const KrotResult result =
      Succeeded(RunKrot({"model_analyzer", "--path", folder_ / "input"}));
  EXPECT_THAT(result.out, HasSubstr("Points: 0\n"));
}

TEST_F(Commands, ModelSynthesizerMakesWhatItsOptionsSay) {
  Words arguments = {"model_synthesizer", "--output_path", folder_ / "start",
                     "--ground_truth_path", folder_ / "truth"};
  std::istringstream words(
      "--output_type TXT --overwrite 1 --random_seed 5 --Scene.layout street "
      "--Scene.num_frames 7 --Scene.num_points 90 --Scene.track_length 3 "
      "--Scene.camera_model OPENCV --Scene.image_width 800 "
      "--Scene.image_height 600 --Scene.focal_length_factor 0.9 "
      "--Scene.has_rigs 1 --Scene.sensors_per_rig 2 --Scene.rig_baseline 0.05 "
      "--Scene.rig_rotation_deg 5 --Scene.pixel_noise 0.3 "
      "--Scene.outlier_ratio 0.02 --Scene.duplicate_ratio 0.01 "
      "--Scene.start_translation_noise 0.01 --Scene.start_point_noise 0.02 "
      "--Scene.rotation_noise_deg 0.1");
  for (std::string word; words >> word;) arguments.push_back(word);
  Succeeded(RunKrot(arguments));

  SceneOptions options = SceneOf(7, 90, 3, 0.3, 5);
  options.layout = SceneLayout::kStreet;
  options.camera_model_id = 4;
  options.image_width = 800;
  options.image_height = 600;
  options.focal_length_factor = 0.9;
  options.sensors_per_rig = 2;
  options.rig_baseline = 0.05;
  options.rig_rotation_deg = 5;
  options.outlier_ratio = 0.02;
  options.duplicate_ratio = 0.01;
  options.start_translation_noise = 0.01;
  options.start_point_noise = 0.02;
  options.rotation_noise_deg = 0.1;
  const SyntheticScene scene = SynthesizeScene(options);
  EXPECT_THAT(Load(folder_ / "start"), IsModel(scene.model));
  EXPECT_THAT(Load(folder_ / "truth"), IsModel(scene.ground_truth));
  Succeeded(RunKrot(arguments));  // overwrites
}

TEST_F(Commands, ModelSynthesizerWritesLegacyModels) {
  Succeeded(RunKrot({"model_synthesizer", "--output_path", folder_ / "scene",
                     "--Scene.has_rigs", "0"}));
  EXPECT_EQ(FileNames(folder_ / "scene"),
            (Words{"cameras.bin", "images.bin", "points3D.bin"}));
}

TEST_F(Commands, SolverHalvesTheCostAtLeastWhereObservationsAreExact) {
  SceneOptions options = SmallScene();
  options.pixel_noise = 0;
  Save(SynthesizeScene(options).model, folder_ / "input");
  Succeeded(Run("solver", {"--Solver.method", "res_int",
                           "--ResInt.sweep_tolerance", "1e-3"}));
  EXPECT_LT(Report()["cost_final"],
            0.5 * Report()["cost_initial"].get<double>());
}

}  // namespace
}  // namespace krot::internal
