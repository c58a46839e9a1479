#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/model/rigs.h"
#include "tests/cli/colmap.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

// `krot solver` on models that COLMAP and others made, with COLMAP as judge.

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

using Eigen::Vector3d;

struct CentreStatistics {
  Vector3d centroid = Vector3d::Zero();
  double rms_distance = 0;  // to the centroid
};

CentreStatistics Centres(const Model& model) {
  std::vector<Vector3d> centres;
  for (const ImageGeometry& geometry : ImageGeometries(model)) {
    centres.push_back(-geometry.cam_from_world.rotation.transpose() *
                      geometry.cam_from_world.translation);
  }
  CentreStatistics statistics;
  for (const Vector3d& centre : centres) statistics.centroid += centre;
  const double count = static_cast<double>(centres.size());
  statistics.centroid /= count;
  for (const Vector3d& centre : centres) {
    statistics.rms_distance += (centre - statistics.centroid).squaredNorm();
  }
  statistics.rms_distance = std::sqrt(statistics.rms_distance / count);
  return statistics;
}

std::map<Point3DId, double> StoredErrors(const Model& model) {
  std::map<Point3DId, double> errors;
  for (const Point3D& point : model.points3D) errors[point.id] = point.error;
  return errors;
}

struct RealModel {
  const char* folder;
  double optimum_px;  // known to five digits
};

std::string NameOf(const ::testing::TestParamInfo<RealModel>& test) {
  return test.param.folder;
}

void ExpectCertifiedOptimum(const Json& report, double optimum_px) {
  EXPECT_EQ(report["certified"], true);
  EXPECT_EQ(report["termination"], "gap_reached");
  const double lowest_px = report["finish"]["lowest_cost"];
  const double bound_px = report["lower_bound"];
  EXPECT_LE(lowest_px - bound_px, 1e-4 * lowest_px);
  EXPECT_NEAR(lowest_px, optimum_px, 1e-4 * optimum_px);
  EXPECT_LE(bound_px, report["cost_final"]);
  // What the finish gives up of it, and what for.
  EXPECT_LE(report["cost_final"], (1 + 5e-4) * bound_px);
  EXPECT_LT(report["finish"]["cost_final"], report["finish"]["cost_initial"]);
  EXPECT_EQ(report["finish"]["termination"], "converged");
}

class SolverOnRealModel : public ::testing::TestWithParam<RealModel> {
 protected:
  void SetUp() override {
    if (!RealModels()) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
    input_ = *RealModels() / GetParam().folder;
    Succeeded(RunKrot({"solver", "--input_path", input_, "--output_path",
                       output_, "--report_path", folder_ / "report.json",
                       "--certificate_path", folder_ / "certificate.json"}));
    before_ = Load(input_);
    after_ = Load(output_);
  }

  void ExpectLowerCostAndSameContents();
  void ExpectColmapReadsConvertsAndAdjusts();
  void ExpectColmapComputesTheStoredErrors();

  bool Colmap(const Words& arguments) {
    return RunColmap(arguments, folder_ / "colmap.log");
  }

  TempFolder folder_;
  fs::path input_;
  fs::path output_ = folder_ / "output";
  Model before_;
  Model after_;
};

// The three in one test: the solve is what takes the time.
TEST_P(SolverOnRealModel, ReachesTheCertifiedOptimumAndPleasesColmap) {
  ExpectLowerCostAndSameContents();
  if (!HasColmap()) GTEST_SKIP() << "COLMAP is not installed";
  ExpectColmapReadsConvertsAndAdjusts();
  ExpectColmapComputesTheStoredErrors();
}

void SolverOnRealModel::ExpectLowerCostAndSameContents() {
  const auto report = ReadJson(folder_ / "report.json");
  EXPECT_LE(report["cost_final"], report["cost_initial"]);
  ExpectCertifiedOptimum(report, GetParam().optimum_px);
  Succeeded(RunKrot({"certificate_checker", "--input_path", output_,
                     "--certificate_path", folder_ / "certificate.json"}));
  EXPECT_THAT(after_, IsModel(before_, Ignoring{true, true, true}));

  const CentreStatistics before = Centres(before_);
  const CentreStatistics after = Centres(after_);
  const double tolerance = 1e-9 * before.rms_distance;
  EXPECT_LT((after.centroid - before.centroid).norm(), tolerance);
  EXPECT_NEAR(after.rms_distance, before.rms_distance, tolerance);
}

void SolverOnRealModel::ExpectColmapReadsConvertsAndAdjusts() {
  ASSERT_TRUE(Colmap({"model_analyzer", "--path", output_}));
  std::istringstream figures(ReadBytes(folder_ / "colmap.log"));
  const std::string ours = RunKrot({"model_analyzer", "--path", output_}).out;
  for (std::string figure; std::getline(figures, figure);) {
    EXPECT_THAT(ours, HasSubstr(figure + "\n"));
  }
  for (const char* name : {"text", "binary", "adjusted"}) {
    fs::create_directory(folder_ / name);
  }
  EXPECT_TRUE(
      Colmap({"model_converter", "--input_path", output_, "--output_path",
              folder_ / "text", "--output_type", "TXT"}));
  EXPECT_TRUE(
      Colmap({"model_converter", "--input_path", folder_ / "text",
              "--output_path", folder_ / "binary", "--output_type", "BIN"}));
  EXPECT_TRUE(Colmap({"bundle_adjuster", "--input_path", output_,
                      "--output_path", folder_ / "adjusted",
                      "--BundleAdjustment.max_num_iterations", "2"}));
}

void SolverOnRealModel::ExpectColmapComputesTheStoredErrors() {
  fs::create_directory(folder_ / "filtered");
  ASSERT_TRUE(Colmap({"point_filtering", "--input_path", output_,
                      "--output_path", folder_ / "filtered",
                      "--max_reproj_error", "1e6", "--min_tri_angle", "0"}));
  const std::map<Point3DId, double> colmap =
      StoredErrors(Load(folder_ / "filtered"));
  const std::map<Point3DId, double> ours = StoredErrors(after_);
  ASSERT_EQ(colmap.size(), ours.size());
  double largest_difference = 0;
  for (const auto& [id, error_px] : ours) {
    largest_difference =
        std::max(largest_difference, std::abs(error_px - colmap.at(id)));
  }
  EXPECT_LT(largest_difference, 1e-6);
}

INSTANTIATE_TEST_SUITE_P(
    Local, SolverOnRealModel,
    ::testing::Values(
        RealModel{"crane8_txt", 3.1011}, RealModel{"door", 4.3929},
        RealModel{"door_colmap", 3.4205}, RealModel{"fountain11", 3.2858},
        RealModel{"longtracks92", 3.4528}, RealModel{"maupertuis4_txt", 2.5369},
        RealModel{"outliers12", 18.9275}, RealModel{"room50_opencv", 3.6473},
        RealModel{"slow28", 2.8965}, RealModel{"south128", 3.1778},
        RealModel{"south128_full", 3.5773},
        RealModel{"task41_rigs_frames", 3.5041}, RealModel{"tower", 4.6315},
        RealModel{"tower_init", 4.6315}, RealModel{"two_cameras44", 2.9279}),
    NameOf);

// The smaller ones: what counts here is where they start.
class StartOnRealModel : public ::testing::TestWithParam<RealModel> {
 protected:
  void SetUp() override {
    if (!RealModels()) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  }

  void ExpectOptimumFrom(const Model& start, const Words& more) {
    TempFolder folder;
    Save(start, folder / "start");
    Succeeded(
        RunKrot({"solver", "--input_path", folder / "start", "--output_path",
                 folder / "output", "--report_path", folder / "report.json"},
                more));
    const auto report = ReadJson(folder / "report.json");
    ExpectCertifiedOptimum(report, GetParam().optimum_px);
    EXPECT_EQ(report["num_observations"], start.track_elements.size());
  }

  Model Input() const { return Load(*RealModels() / GetParam().folder); }
};

TEST_P(StartOnRealModel, ThatIsPerturbedByATenthOfTheSceneGivesTheOptimum) {
  ExpectOptimumFrom(Perturbed(Input(), 0.1, 7), {});
}

TEST_P(StartOnRealModel, FromNothingGivesTheOptimum) {
  ExpectOptimumFrom(Input(), {"--Solver.init", "feasible"});
}

TEST_P(StartOnRealModel, WithoutTranslationsGivesTheOptimum) {
  ExpectOptimumFrom(WithoutTranslations(Input()), {});
}

INSTANTIATE_TEST_SUITE_P(Local, StartOnRealModel,
                         ::testing::Values(RealModel{"crane8_txt", 3.1011},
                                           RealModel{"fountain11", 3.2858},
                                           RealModel{"maupertuis4_txt", 2.5369},
                                           RealModel{"room50_opencv", 3.6473},
                                           RealModel{"south128", 3.1778},
                                           RealModel{"task41_rigs_frames",
                                                     3.5041},
                                           RealModel{"two_cameras44", 2.9279}),
                         NameOf);

TEST(SolverOnOnePoint, SaysThatAllErrorsAreZero) {
  if (!RealModels()) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  TempFolder folder;
  const KrotResult result = Succeeded(
      RunKrot({"solver", "--input_path", *RealModels() / "edge_one_point",
               "--output_path", folder / "output"}));
  EXPECT_THAT(result.out, HasSubstr("nothing left to lower"));
  EXPECT_THAT(result.out, HasSubstr("Every error is zero up to rounding"));
}

class SettingsOnRealModel : public ::testing::TestWithParam<const char*> {};

TEST_P(SettingsOnRealModel, FastOnesEndNoHigherThanThePapers) {
  if (!RealModels()) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  TempFolder folder;
  const auto final_cost = [&](const std::string& settings) -> double {
    Succeeded(RunKrot({"solver", "--input_path", *RealModels() / GetParam(),
                       "--output_path", folder / settings, "--report_path",
                       folder / settings / "report.json", "--Solver.method",
                       "res_int", "--Solver.settings", settings}));
    return ReadJson(folder / settings / "report.json")["cost_final"];
  };
  EXPECT_LE(final_cost("fast"), final_cost("paper"));
}

INSTANTIATE_TEST_SUITE_P(Local, SettingsOnRealModel,
                         ::testing::Values("crane8_txt", "longtracks92",
                                           "maupertuis4_txt", "room50_opencv",
                                           "south128", "task41_rigs_frames",
                                           "two_cameras44"),
                         [](const auto& test) {
                           return std::string(test.param);
                         });

struct WrongRealModel {
  const char* folder;
  int exit_code;
  const char* part_of_sentence;
};

class SolverOnWrongRealModel : public ::testing::TestWithParam<WrongRealModel> {
};

TEST_P(SolverOnWrongRealModel, SaysSoInOneSentence) {
  if (!RealModels()) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  TempFolder folder;
  const KrotResult result =
      RunKrot({"solver", "--input_path", *RealModels() / GetParam().folder,
               "--output_path", folder / "output"});
  EXPECT_EQ(result.exit_code, GetParam().exit_code);
  EXPECT_THAT(result.err,
              IsOneSentence("krot solver", GetParam().part_of_sentence));
  EXPECT_TRUE(FileNames(folder.path()).empty());
}

INSTANTIATE_TEST_SUITE_P(
    Local, SolverOnWrongRealModel,
    ::testing::Values(
        WrongRealModel{"edge_tracks_of_one_txt", 3,
                       "1000 observations left out (short_track 1000)"},
        WrongRealModel{"edge_lfs_pointers", 2, "Git LFS"}),
    [](const auto& test) { return std::string(test.param.folder); });

// From nothing its errors end above the input's.
TEST(SolverOnWide17, GoesOnFromTheModelWhereAStartFromNothingIsNoBetter) {
  if (!RealModels()) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  const TempFolder folder;
  Succeeded(RunKrot({"solver", "--input_path", *RealModels() / "wide17",
                     "--output_path", folder / "output", "--report_path",
                     folder / "r.json", "--Solver.init", "feasible"}));
  const Json report = ReadJson(folder / "r.json");
  EXPECT_EQ(report["termination"], "gap_reached");
  EXPECT_LT(report["pixel_error"]["after"]["max"],
            report["pixel_error"]["before"]["max"]);
}

}  // namespace
}  // namespace krot::internal
