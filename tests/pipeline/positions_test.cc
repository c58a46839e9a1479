// Cameras and points within a radius of where they are known to be. The oracle
// of a bound is the dual of the balls and ellipsoids themselves, which knows no
// cones, levels and rounds.

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numeric>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/certificate_file.h"
#include "krot/convert/reprojection.h"
#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "krot/pipeline/solve_model.h"
#include "krot/pipeline/stages.h"
#include "krot/synthetic/scene.h"
#include "tests/convert/lens_model.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;
using ::testing::AnyOf;

using Of = KnownPosition::Of;

constexpr double kKept = 1e-6;  // of a radius

SceneOptions Options() {
  SceneOptions options = SceneOf(6, 60, 4, 0.5, 3);
  options.start_point_noise = 0.002;
  return options;
}

Vector3d CentreOf(const Model& model, int32_t image) {
  return Center(ImageGeometries(model)[image].cam_from_world);
}

Vector3d PlaceOf(const Model& model, const KnownPosition& position) {
  return position.of == Of::kImage ? CentreOf(model, position.index)
                                   : model.points3D[position.index].xyz;
}

// Every `step`-th image or point, `radius` around what is `off` radii from
// where the model has it.
std::vector<KnownPosition> Positions(const Model& model, double radius,
                                     double off, int step, Of of = Of::kImage) {
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  std::vector<KnownPosition> positions;
  const size_t count =
      of == Of::kImage ? model.images.size() : model.points3D.size();
  for (size_t n = 0; n < count; n += step) {
    const Vector3d direction =
        Vector3d(normal(generator), normal(generator), normal(generator))
            .normalized();
    KnownPosition position{of, static_cast<int32_t>(n), {}};
    position.region =
        BallAround(PlaceOf(model, position) + off * radius * direction, radius);
    positions.push_back(position);
  }
  return positions;
}

// Flat and turned, as of a receiver that knows little of one direction.
std::vector<KnownPosition> Flattened(std::vector<KnownPosition> positions) {
  for (KnownPosition& position : positions) {
    position.region.semi_axes.x() *= 0.8;
    position.region.semi_axes.z() *= 2;
    position.region.world_from_axes = {0.8, 0.3, -0.5, 0.1};
  }
  return positions;
}

std::vector<KnownPosition> Scaled(std::vector<KnownPosition> positions,
                                  double factor) {
  for (KnownPosition& position : positions) {
    position.region.semi_axes *= factor;
  }
  return positions;
}

Model Wiped(Model model) {
  for (Frame& frame : model.frames) frame.rig_from_world.translation.setZero();
  for (Image& image : model.images) image.cam_from_world.translation.setZero();
  for (Point3D& point : model.points3D) point.xyz.setZero();
  return model;
}

SolveModelResult SolveWith(const Model& model,
                           const std::vector<KnownPosition>& positions) {
  SolveModelOptions options;
  options.problem.positions = positions;
  options.describe_certificate = true;
  return SolveModel(model, options, {1});
}

double LargestRatio(const Model& model,
                    const std::vector<KnownPosition>& positions) {
  double largest = 0;
  for (const KnownPosition& p : positions) {
    const Vector3d in_axes = p.region.world_from_axes.normalized().inverse() *
                             (PlaceOf(model, p) - p.region.centre);
    largest =
        std::max(largest, in_axes.cwiseQuotient(p.region.semi_axes).norm());
  }
  return largest;
}

// The largest value of F'x over a region.
double Largest(const Ellipsoid& region, const Vector3d& force) {
  const Vector3d in_axes =
      region.world_from_axes.normalized().inverse() * force;
  return force.dot(region.centre) +
         in_axes.cwiseProduct(region.semi_axes).norm();
}

// The largest value of sum_i (delta lambda_i w_i + y_i'v_i), over all cameras
// and points in their regions and all others anywhere, in units of sum_i delta
// lambda_i r; of a pinhole without rigs. Not above zero, it proves delta.
double DualValue(const Model& model, const CertificateFile& file) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const IdIndex<ImageId> images(model.images);
  std::vector<Vector3d> on_camera(model.images.size(), Vector3d::Zero());
  std::vector<Vector3d> on_point(model.points3D.size(), Vector3d::Zero());
  const IdIndex<Point3DId> points(model.points3D);
  double scale = 0;
  for (const CertificateFile::SupportObservation& o : file.observations) {
    const int32_t n = *images.Find(o.image_id);
    const Camera& camera = model.cameras[geometries[n].camera];
    const Point2D& point2D = model.images[n].points2D[o.point2D_idx];
    const Eigen::Matrix3d E =
        *RowAtProjection(camera, {point2D.x, point2D.y}, o.bearing);
    const Vector3d force =
        geometries[n].cam_from_world.rotation.transpose() *
        (E.transpose() * Vector3d(file.rows_bound * o.lambda, o.y[0], o.y[1]));
    on_point[*points.Find(o.point3D_id)] += force;
    on_camera[n] -= force;
    scale += file.rows_bound * o.lambda;
  }
  double value = 0;
  double radius = 0;
  for (const CertificateFile::Position& p : file.positions) {
    Vector3d& pull = p.of == Of::kImage
                         ? on_camera[*images.Find(static_cast<ImageId>(p.id))]
                         : on_point[*points.Find(p.id)];
    value += Largest(p.region, pull);
    pull.setZero();
    radius = std::max(radius, p.region.semi_axes.maxCoeff());
  }
  for (const Vector3d& sum : on_point) EXPECT_LT(sum.norm(), 1e-9 * scale);
  for (const Vector3d& sum : on_camera) EXPECT_LT(sum.norm(), 1e-9 * scale);
  return value / (scale * radius);
}

void ExpectProved(const Model& model, const SolveModelResult& result,
                  const std::vector<KnownPosition>& positions) {
  const SolveSummary& summary = result.summary;
  EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
  EXPECT_LE(LargestRatio(result.model, positions), 1 + kKept);
  EXPECT_NEAR(summary.largest_position_ratio,
              LargestRatio(result.model, positions), 1e-6);
  ASSERT_TRUE(summary.certificate);
  EXPECT_LE(summary.LowestCost(), (1 + 2e-4) * *summary.lower_bound);
  const CertificateVerdict verdict =
      VerifyCertificateFile(model, *summary.certificate);
  EXPECT_TRUE(verdict.is_accepted) << verdict.refusal;
}

// Rows of a level bound the errors only where their optimum is above it.
TEST(Positions, OfALevelAboveTheOptimumProveNothing) {
  const Model model = SynthesizeScene(Options()).model;
  BuildProblemOptions options;
  options.positions = Positions(model, 0.03, 1.3, 1);
  BuiltProblem built = BuildProblem(model, options);
  std::vector<int64_t> all(built.problem.observations.size());
  std::iota(all.begin(), all.end(), 0);
  const auto prove_at = [&](double level) {
    built.position_level = level;
    TakePositionRows(built, built.start, &built.problem);
    return ProveInPixels(model, built, built.start, Norm::L2(), all, 0.0, {});
  };
  const std::optional<PixelCertificate> proof = prove_at(0.1);
  ASSERT_TRUE(proof);
  const PixelCertificateCheck check =
      CheckPixelCertificate(model, built, Norm::L2(), *proof, {});
  EXPECT_TRUE(check.is_accepted) << check.refusal;
  EXPECT_FALSE(prove_at(100));
}

TEST(Positions, ThatHoldCamerasBackHaveTheOptimumThatTheirDualProves) {
  SceneOptions options = Options();
  options.camera_model_id = 0;
  const Model model = SynthesizeScene(options).model;
  const auto expect_proved = [&](const std::vector<KnownPosition>& positions) {
    const SolveModelResult result = SolveWith(model, positions);
    ExpectProved(model, result, positions);
    EXPECT_FALSE(result.summary.support_positions.empty());
    ASSERT_TRUE(result.summary.certificate);
    EXPECT_LE(DualValue(model, *result.summary.certificate), 1e-6);
  };
  for (const double radius : {0.003, 0.03, 0.3}) {
    SCOPED_TRACE(radius);
    expect_proved(Positions(model, radius, 1.3, 1));
    expect_proved(Flattened(Positions(model, radius, 1.3, 1)));
    const std::vector<KnownPosition> of_points =
        Positions(model, radius, 1.3, 7, Of::kPoint3D);
    expect_proved(of_points);
    expect_proved(Flattened(of_points));
    std::vector<KnownPosition> of_both = Positions(model, radius, 1.1, 2);
    of_both.insert(of_both.end(), of_points.begin(), of_points.end());
    expect_proved(of_both);
  }
}

TEST(Positions, AreGivenTheSmallestFactorThatABoundNeeds) {
  const Model model = SynthesizeScene(Options()).model;
  std::vector<KnownPosition> positions = Positions(model, 0.01, 1.5, 2);
  const std::vector<KnownPosition> of_points =
      Positions(model, 0.01, 1.5, 9, Of::kPoint3D);
  positions.insert(positions.end(), of_points.begin(), of_points.end());
  const double as_given = *SolveWith(model, positions).summary.lower_bound;
  const double without = SolveWith(model, {}).summary.LowestCost();
  SolveModelOptions options;
  options.problem.positions = positions;
  options.inflate_positions_to = (as_given + without) / 2;
  const SolveModelResult result = SolveModel(model, options, {1});
  ASSERT_TRUE(result.summary.position_factor);
  const PositionFactor& factor = *result.summary.position_factor;
  EXPECT_GT(factor.lower_bound, 1);
  EXPECT_LE(factor.factor, 1.003 * factor.lower_bound);
  EXPECT_LE(result.summary.cost_final, *options.inflate_positions_to);
  EXPECT_LE(LargestRatio(result.model, Scaled(positions, factor.factor)),
            1 + kKept);
  const SolveSummary below =
      SolveWith(model, Scaled(positions, factor.lower_bound)).summary;
  EXPECT_GT(below.LowestCost(), *options.inflate_positions_to);
  ASSERT_TRUE(factor.certificate);
  const CertificateVerdict verdict =
      VerifyCertificateFile(model, *factor.certificate);
  EXPECT_TRUE(verdict.is_accepted) << verdict.refusal;
  EXPECT_GT(verdict.lower_bound, *options.inflate_positions_to);

  options.inflate_positions_to = 2 * as_given;
  EXPECT_EQ(SolveModel(model, options, {1}).summary.position_factor->factor, 1);
  options.inflate_positions_to = 0.5 * without;
  const SolveSummary refuted = SolveModel(model, options, {1}).summary;
  EXPECT_EQ(refuted.termination, SolveTermination::kInfeasible);
  EXPECT_GT(*refuted.lower_bound, *options.inflate_positions_to);
}

TEST(Positions, ThatHardlyHoldAnythingBackTakeFewRounds) {
  const Model model = SynthesizeScene(Options()).model;
  const std::vector<KnownPosition> positions = Positions(model, 0.05, 1, 1);
  SolveModelOptions options;
  options.problem.positions = positions;
  options.inflate_positions_to =
      1.01 * SolveWith(model, {}).summary.LowestCost();
  const SolveSummary inflated = SolveModel(model, options, {1}).summary;
  ASSERT_TRUE(inflated.position_factor);
  const SolveSummary summary =
      SolveWith(model, Scaled(positions, inflated.position_factor->factor))
          .summary;
  EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
  EXPECT_LE(summary.rounds.size(), 15);
}

TEST(Positions, ThatHoldNothingBackLeaveTheOptimum) {
  const Model model = SynthesizeScene(Options()).model;
  const SolveModelResult free = SolveWith(model, {});
  const std::vector<KnownPosition> positions =
      Positions(free.model, 0.05, 0.2, 2);
  const SolveModelResult result = SolveWith(model, positions);
  ExpectProved(model, result, positions);
  EXPECT_LE(*result.summary.lower_bound, free.summary.LowestCost());
  EXPECT_LE(*free.summary.lower_bound, result.summary.LowestCost());
}

TEST(Positions, OfOneOrTwoCamerasMoveTheModelThere) {
  const Model model = SynthesizeScene(Options()).model;
  const SolveModelResult free = SolveWith(model, {});
  for (const int count : {1, 2}) {
    SCOPED_TRACE(count);
    std::vector<KnownPosition> positions;
    for (int32_t n = 0; n < count; ++n) {
      positions.push_back(
          {Of::kImage, n,
           BallAround(Vector3d(70, -40, 90) + 25 * CentreOf(model, n), 1)});
    }
    const SolveModelResult result = SolveWith(model, positions);
    ExpectProved(model, result, positions);
    EXPECT_EQ(result.summary.init, SolveInit::kModel);
    EXPECT_EQ(result.summary.num_observations, free.summary.num_observations);
    EXPECT_LE(*result.summary.lower_bound, free.summary.LowestCost());
    EXPECT_LE(*free.summary.lower_bound, result.summary.LowestCost());
  }
}

// Of one model a lens hides observations from a start from nothing, which would
// leave them out; of the other a point lies in a camera and loses its depth
// where the model is moved.
TEST(Positions, OfOneCameraOfARealModelTakeAsFewRoundsAsNone) {
  const char* root = std::getenv("KROT_REAL_MODELS");
  if (root == nullptr) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  for (const auto& [name, init] :
       {std::pair("fold19", SolveInit::kModel),
        std::pair("drone72_rig", SolveInit::kFeasible)}) {
    SCOPED_TRACE(name);
    const std::filesystem::path folder = std::filesystem::path(root) / name;
    const Model model = ReadModel(folder, DetectModelFormat(folder));
    const SolveModelResult free = SolveWith(model, {});
    const std::vector<KnownPosition> positions = {
        {Of::kImage, 0,
         BallAround(CentreOf(model, 0) + Vector3d(7, -12, 15), 0.03)}};
    const SolveModelResult result = SolveWith(model, positions);
    ExpectProved(model, result, positions);
    EXPECT_EQ(result.summary.init, init);
    EXPECT_EQ(result.summary.num_observations, free.summary.num_observations);
    EXPECT_LE(result.summary.rounds.size(), free.summary.rounds.size());
  }
}

// Where the rows' proof rests on positions, their level matters even if no
// camera is at its bound just now. The joint solver alone, which tries no other
// way, needs the right one.
TEST(Positions, ThatHoldCamerasOfARealModelBackAreProvedInOneWay) {
  const char* root = std::getenv("KROT_REAL_MODELS");
  if (root == nullptr) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  const std::filesystem::path folder =
      std::filesystem::path(root) / "bandgap10";
  const Model model = ReadModel(folder, DetectModelFormat(folder));
  Vector3d first = CentreOf(model, 0), last = first;
  for (size_t n = 0; n < model.images.size(); ++n) {
    first = first.cwiseMin(CentreOf(model, static_cast<int32_t>(n)));
    last = last.cwiseMax(CentreOf(model, static_cast<int32_t>(n)));
  }
  for (const double share : {3e-5, 1e-4, 3e-4}) {
    SCOPED_TRACE(share);
    SolveModelOptions options;
    options.method = SolveMethod::kJoint;
    options.problem.positions =
        Positions(model, share * (last - first).norm(), 0.5, 1);
    options.describe_certificate = true;
    ExpectProved(model, SolveModel(model, options, {1}),
                 options.problem.positions);
  }
}

TEST(Positions, ThatAllowOnlyUselessErrorsLeaveTheModel) {
  LensModelOptions lens;
  lens.num_points = 40;
  const Model model = MakeLensModel(lens);
  std::vector<KnownPosition> positions;
  for (int32_t n = 0; n < 3; ++n) {
    const Vector3d off = 20 * (n - 1) * Vector3d(1, n, 2 * n - 1);
    positions.push_back(
        {Of::kImage, n, BallAround(CentreOf(model, n) + off, 0.01)});
  }
  for (const SolveMethod method : {SolveMethod::kAuto, SolveMethod::kJoint}) {
    SolveModelOptions options;
    options.method = method;
    options.problem.positions = positions;
    const SolveModelResult result = SolveModel(model, options, {1});
    EXPECT_THAT(result.summary.termination, AnyOf(SolveTermination::kInfeasible,
                                                  SolveTermination::kNoStart));
    EXPECT_EQ(ModelComparison({}).FirstDifference(result.model, model), "");
  }
}

// The gauge, which observations leave free, drifts out of regions that hold
// nothing back, between the cones that stand for them.
TEST(Positions, ThatHoldNothingBackLeaveTheOptimumOfARealModel) {
  const char* root = std::getenv("KROT_REAL_MODELS");
  if (root == nullptr) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  const std::filesystem::path folder =
      std::filesystem::path(root) / "drone72_rig";
  const Model model = ReadModel(folder, DetectModelFormat(folder));
  const SolveModelResult free = SolveWith(model, {});
  for (const double radius : {0.01, 0.1, 1.0}) {
    SCOPED_TRACE(radius);
    const std::vector<KnownPosition> positions =
        Positions(model, radius, 0.2, 1);
    const SolveModelResult result = SolveWith(model, positions);
    ExpectProved(model, result, positions);
    EXPECT_LE(*free.summary.lower_bound, result.summary.LowestCost());
    EXPECT_LE(*result.summary.lower_bound, free.summary.LowestCost());
  }
}

TEST(Positions, BringAModelWithoutTranslationsToTheSameOptimum) {
  const Model model = SynthesizeScene(Options()).model;
  const Model wiped = Wiped(model);
  for (const std::vector<KnownPosition>& positions :
       {Positions(model, 0.02, 1.2, 1),
        Flattened(Positions(model, 0.02, 1.2, 10, Of::kPoint3D))}) {
    const SolveModelResult result = SolveWith(model, positions);
    const SolveModelResult from_nothing = SolveWith(wiped, positions);
    ExpectProved(wiped, from_nothing, positions);
    EXPECT_LE(*result.summary.lower_bound, from_nothing.summary.LowestCost());
    EXPECT_LE(*from_nothing.summary.lower_bound, result.summary.LowestCost());
  }
}

TEST(Positions, OfRigsAndFarAwayAreKept) {
  SceneOptions options = Options();
  options.sensors_per_rig = 2;
  options.rig_baseline = 0.1;
  const Model near = SynthesizeScene(options).model;
  const std::vector<KnownPosition> positions = Positions(near, 0.02, 1.2, 2);
  const SolveModelResult result = SolveWith(near, positions);
  ExpectProved(near, result, positions);

  const Vector3d shift(5e5, -3e5, 4e5);
  Model far = near;
  std::vector<KnownPosition> shifted = positions;
  for (Frame& frame : far.frames) {
    frame.rig_from_world.translation -= frame.rig_from_world.Rotation() * shift;
  }
  for (Image& image : far.images) {
    image.cam_from_world.translation -= image.cam_from_world.Rotation() * shift;
  }
  for (Point3D& point : far.points3D) point.xyz += shift;
  for (KnownPosition& position : shifted) position.region.centre += shift;
  const SolveModelResult of_far = SolveWith(far, shifted);
  EXPECT_EQ(of_far.summary.termination, SolveTermination::kGapReached);
  EXPECT_LE(LargestRatio(of_far.model, shifted), 1 + 2 * kKept);
  EXPECT_NEAR(of_far.summary.LowestCost(), result.summary.LowestCost(),
              3e-4 * result.summary.LowestCost());
  const CertificateVerdict verdict =
      VerifyCertificateFile(far, *of_far.summary.certificate);
  EXPECT_TRUE(verdict.is_accepted) << verdict.refusal;
}

TEST(Positions, ThatContradictTheObservationsAreNamed) {
  const Model model = SynthesizeScene(Options()).model;
  std::vector<KnownPosition> positions = Positions(model, 0.02, 0, 1);
  positions[3].region.centre += Vector3d(0.05, 0.03, 0.02);
  const SolveModelResult result = SolveWith(model, positions);
  ExpectProved(model, result, positions);
  const auto names_it = [&](const SolveSummary& summary) {
    return std::any_of(
        summary.support_positions.begin(), summary.support_positions.end(),
        [&](const auto& p) { return p.image_name == model.images[3].name; });
  };
  EXPECT_TRUE(names_it(result.summary));

  SolveModelOptions options;
  options.problem.positions = positions;
  options.init_max_error = *result.summary.lower_bound / 2;
  const SolveModelResult refused = SolveModel(model, options, {1});
  EXPECT_EQ(refused.summary.termination, SolveTermination::kInfeasible);
  ASSERT_TRUE(refused.summary.is_certified);
  EXPECT_GT(*refused.summary.lower_bound, options.init_max_error);
  EXPECT_TRUE(names_it(refused.summary));
}

TEST(Positions, ThatNoRigCanHaveAreInConflictWithEachOther) {
  SceneOptions options = Options();
  options.sensors_per_rig = 2;
  options.rig_baseline = 0.1;
  const Model model = SynthesizeScene(options).model;
  std::vector<KnownPosition> positions = Positions(model, 0.005, 0, 1);
  // The two cameras of the first rig, twice as far from each other.
  const Vector3d apart =
      positions[1].region.centre - positions[0].region.centre;
  positions[0].region.centre -= apart / 2;
  positions[1].region.centre += apart / 2;
  const SolveSummary summary = SolveWith(model, positions).summary;
  EXPECT_EQ(summary.termination, SolveTermination::kInfeasible);
  EXPECT_TRUE(summary.is_certified);
  EXPECT_TRUE(std::any_of(
      summary.support_positions.begin(), summary.support_positions.end(),
      [&](const auto& p) { return p.image_name == model.images[0].name; }));
}

TEST(Positions, OfATamperedCertificateAreRefused) {
  const Model model = SynthesizeScene(Options()).model;
  const std::vector<KnownPosition> positions = Positions(model, 0.02, 1.5, 1);
  const CertificateFile file = *SolveWith(model, positions).summary.certificate;
  ASSERT_FALSE(file.positions.empty());
  ASSERT_TRUE(VerifyCertificateFile(model, file).is_accepted);
  const auto is_accepted = [&](const auto& change) {
    CertificateFile tampered = file;
    change(&tampered);
    return VerifyCertificateFile(model, tampered).is_accepted;
  };
  EXPECT_FALSE(is_accepted([](CertificateFile* f) {
    f->lower_bound *= 1.001;
    f->rows_bound *= 1.001;
  }));
  EXPECT_FALSE(is_accepted(
      [](CertificateFile* f) { f->positions[0].region.semi_axes *= 1.1; }));
  EXPECT_FALSE(is_accepted([](CertificateFile* f) { f->positions.clear(); }));
  EXPECT_FALSE(is_accepted(
      [](CertificateFile* f) { f->positions.push_back(f->positions[0]); }));
  EXPECT_FALSE(is_accepted(
      [](CertificateFile* f) { f->positions[0].rows[0].apex *= 2; }));
  EXPECT_FALSE(is_accepted([](CertificateFile* f) {
    for (CertificateFile::Position& p : f->positions) {
      for (CertificateFile::Position::Row& row : p.rows) row.y *= 1.01;
    }
  }));
  EXPECT_FALSE(is_accepted([](CertificateFile* f) {
    f->positions[0].region.semi_axes.y() = std::nan("");
  }));
}

}  // namespace
}  // namespace krot::internal
