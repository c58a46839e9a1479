#include "krot/tolerance/tolerance_analysis.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/known_rotation_problem.h"
#include "tests/oracle/lp_oracle.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr double kTolerance = 0.01;

struct TolerantScene {
  RandomScene scene;
  std::optional<ScaleRow> scale;
  double bound = 0;  // above the estimate's cost
};

// Frame 0 stands still, frame 1 at its distance, unless a baseline sets the
// scale or `num_fixed` frames do.
TolerantScene MakeTolerantScene(unsigned seed, Norm norm, double baseline,
                                int num_fixed) {
  RandomSceneOptions options = {4, 8, baseline > 0 ? 2 : 1, baseline};
  options.seed = seed;
  TolerantScene tolerant;
  tolerant.scene = MakeRandomScene(options);
  KnownRotationProblem& problem = tolerant.scene.problem;
  const Estimate& estimate = tolerant.scene.estimate;
  problem.fixed_translations.resize(problem.num_frames);
  for (int f = 0; f < num_fixed; ++f) {
    problem.fixed_translations[f] = estimate.translations[f];
  }
  if (IsScaleFree(problem)) {
    ScaleRow scale{Pull::Kind::kView, 1};
    scale.direction = (PositionOf(problem, estimate, scale) -
                       PositionOf(problem, estimate, {Pull::Kind::kView, 0}))
                          .normalized();
    tolerant.scale = scale;
  }
  tolerant.bound = 1.2 * Cost(problem, estimate, norm, 1);
  return tolerant;
}

// Up and down each axis at one view and one point.
std::vector<Pull> SomePulls(const KnownRotationProblem& problem) {
  std::vector<Pull> pulls;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      const Vector3d direction = sign * Vector3d::Unit(axis);
      const auto last = static_cast<int32_t>(problem.views.size()) - 1;
      pulls.push_back({Pull::Kind::kView, last, direction});
      pulls.push_back({Pull::Kind::kPoint, axis, direction});
    }
  }
  return pulls;
}

std::vector<double> Stacked(const BlockVector& blocks) {
  std::vector<double> stacked;
  for (const auto* list : {&blocks.points, &blocks.frames}) {
    for (const Vector3d& block : *list) {
      stacked.insert(stacked.end(), block.data(), block.data() + 3);
    }
  }
  return stacked;
}

// The same by translations, t = -R_rw C.
BlockVector ByTranslations(const KnownRotationProblem& problem,
                           const Pull& pull) {
  BlockVector coefficients = CoefficientsOf(problem, {pull});
  const auto rig_from_world = RigFromWorldRotations(problem);
  for (size_t f = 0; f < coefficients.frames.size(); ++f) {
    coefficients.frames[f] = -(rig_from_world[f] * coefficients.frames[f]);
  }
  return coefficients;
}

// What p'x has beside the coefficients times the unknowns.
double ConstantOf(const KnownRotationProblem& problem, const Estimate& estimate,
                  const Pull& pull) {
  return Along(problem, estimate, pull) -
         ByTranslations(problem, pull)
             .Dot({estimate.points, estimate.translations});
}

double ExtentByLp(const TolerantScene& tolerant, Norm norm, const Pull& pull) {
  const KnownRotationProblem& problem = tolerant.scene.problem;
  const Estimate& estimate = tolerant.scene.estimate;
  std::vector<double> e;
  double kept = 0;
  if (tolerant.scale) {
    const BlockVector row = ByTranslations(problem, *tolerant.scale);
    e = Stacked(row);
    kept = row.Dot({estimate.points, estimate.translations});
  }
  return *LargestByLp(problem, norm, tolerant.bound,
                      Stacked(ByTranslations(problem, pull)), e, kept) +
         ConstantOf(problem, estimate, pull);
}

Extent Find(const TolerantScene& tolerant, Norm norm, const Pull& pull) {
  ExtentOptions options;
  options.norm = norm;
  options.bound = tolerant.bound;
  options.tolerance = kTolerance;
  return FindExtent(tolerant.scene.problem, {pull}, tolerant.scale, options, {},
                    tolerant.scene.estimate);
}

struct Gauge {
  double baseline;
  int num_fixed;
};

class FindExtentIn : public testing::TestWithParam<Gauge> {};

TEST_P(FindExtentIn, AgreesWithTheSimplexMethod) {
  for (const Norm norm : {Norm{1}, Norm::LInf()}) {
    for (unsigned seed = 1; seed <= 3; ++seed) {
      const TolerantScene tolerant = MakeTolerantScene(
          seed, norm, GetParam().baseline, GetParam().num_fixed);
      const KnownRotationProblem& problem = tolerant.scene.problem;
      if (!OptimalCostByBisection(problem, norm, 1, 1)) GTEST_SKIP();
      for (const Pull& pull : SomePulls(problem)) {
        SCOPED_TRACE(testing::Message()
                     << "p = " << norm.p << ", seed " << seed << ", "
                     << (pull.kind == Pull::Kind::kView ? "view" : "point")
                     << " along " << pull.direction.transpose());
        const double end = ExtentByLp(tolerant, norm, pull);
        const Extent extent = Find(tolerant, norm, pull);
        const double reached = Along(problem, extent.estimate, pull);
        const double way = end - Along(problem, tolerant.scene.estimate, pull);
        EXPECT_LE(Cost(problem, extent.estimate, norm, 1), tolerant.bound);
        ASSERT_TRUE(extent.proved);
        EXPECT_GE(*extent.proved, end - 1e-7 * way);
        EXPECT_LE(*extent.proved, end + kTolerance * way);
        EXPECT_LE(reached, end + 1e-7 * way);
        EXPECT_GE(reached, end - kTolerance * way);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Gauges, FindExtentIn,
                         testing::Values(Gauge{0, 1}, Gauge{0, 2},
                                         Gauge{0.3, 1}, Gauge{0.3, 2}));

}  // namespace
}  // namespace krot::internal
