#include "krot/finish/least_squares.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double kSlack = 1e-2;

// A scene at its lowest maximum, and a cap a little above.
struct SolvedScene {
  RandomScene scene;
  double cap = 0;
};

SolvedScene Solve(unsigned seed, Norm norm, int num_points = 30,
                  double baseline = 0) {
  RandomSceneOptions options;
  options.num_points = num_points;
  options.views_per_frame = baseline > 0 ? 2 : 1;
  options.baseline = baseline;
  options.seed = seed;
  SolvedScene solved{MakeRandomScene(options)};
  JointOptions joint;
  joint.norm = norm;
  const JointSummary summary =
      SolveJoint(solved.scene.problem, joint, {}, &solved.scene.estimate);
  solved.cap = (1 + kSlack) * summary.cost_final;
  return solved;
}

BoundedOptions OptionsFor(const SolvedScene& solved, Norm norm) {
  BoundedOptions options;
  options.norm = norm;
  options.cap = solved.cap;
  return options;
}

// The first-order conditions by dense algebra: at a minimum the gradient of 1/2
// sum rho is a combination of those of the constraints that hold with equality,
// with no positive coefficient.
class FirstOrder {
 public:
  FirstOrder(const KnownRotationProblem& problem, const Estimate& estimate,
             const ErrorLoss& loss, double cap, Norm norm)
      : problem_(problem),
        gradient_(VectorXd::Zero(Size())),
        scale_(VectorXd::Constant(Size(), 1e-9)) {
    for (const Observation& o : problem.observations) {
      const ViewedPoint viewed = ViewPoint(problem, o, estimate);
      const Vector2d e = viewed.v / viewed.depth;
      const double weight = loss.Weight(e.squaredNorm());
      gradient_ += weight * Pull(o, viewed, e);
      cost_ += loss.Value(e.squaredNorm()) / 2;
      for (const Vector2d& axis : {Vector2d(1, 0), Vector2d(0, 1)}) {
        scale_ += weight * Pull(o, viewed, axis).cwiseAbs2();
      }
      for (const Vector2d& normal : Normals(e, norm)) {
        if (normal.dot(e) > (1 - kNear) * cap) {
          active_.push_back(Pull(o, viewed, normal));
        }
      }
    }
  }

  // g'D^-1 g / (2 cost) of what remains of the gradient, D the diagonal of J'J:
  // the share of the cost that the unknowns would remove, each by itself.
  double Remains() const {
    VectorXd rest = gradient_.cwiseQuotient(scale_.cwiseSqrt());
    std::vector<VectorXd> active = active_;
    for (VectorXd& a : active) a = a.cwiseQuotient(scale_.cwiseSqrt());
    std::vector<double> multiplier(active.size(), 0);
    for (int sweep = 0; sweep < 20000; ++sweep) {  // coordinate descent
      for (size_t n = 0; n < active.size(); ++n) {
        const double next = std::max(
            0.0, multiplier[n] - rest.dot(active[n]) / active[n].squaredNorm());
        rest += (next - multiplier[n]) * active[n];
        multiplier[n] = next;
      }
    }
    return rest.squaredNorm() / (2 * cost_);
  }

  size_t num_active() const { return active_.size(); }

 private:
  static constexpr double kNear = 1e-2;

  Eigen::Index Size() const {
    return 3 * (Eigen::Index{problem_.num_points} + problem_.num_frames);
  }

  // Constraints normal'e <= cap; for p = 2 that of the tangent at e.
  static std::vector<Vector2d> Normals(const Vector2d& e, Norm norm) {
    if (norm.p == 2) return {e.normalized()};
    if (norm.p == 1) return {{1, 1}, {1, -1}, {-1, 1}, {-1, -1}};
    return {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
  }

  // The gradient of q'e.
  VectorXd Pull(const Observation& o, const ViewedPoint& viewed,
                const Vector2d& q) const {
    const View& view = problem_.views[o.view];
    const Vector2d e = viewed.v / viewed.depth;
    const Eigen::Vector3d cam =
        (o.E.bottomRows<2>() - e * o.E.row(0)).transpose() * q / viewed.depth;
    VectorXd pull = VectorXd::Zero(Size());
    pull.segment<3>(3 * o.point) =
        view.cam_from_world_rotation.transpose() * cam;
    pull.segment<3>(3 * (problem_.num_points + view.frame)) =
        view.cam_from_rig_rotation.transpose() * cam;
    return pull;
  }

  const KnownRotationProblem& problem_;
  double cost_ = 0;
  VectorXd gradient_;
  VectorXd scale_;
  std::vector<VectorXd> active_;
};

class BoundedLeastSquares : public testing::TestWithParam<double> {
 protected:
  Norm norm() const { return {GetParam()}; }
};

TEST_P(BoundedLeastSquares, EndsWhereDenseAlgebraFindsTheFirstOrderConditions) {
  for (const double baseline : {0.0, 0.3}) {
    for (const ErrorLoss::Kind loss :
         {ErrorLoss::Kind::kTrivial, ErrorLoss::Kind::kHuber,
          ErrorLoss::Kind::kCauchy}) {
      for (unsigned seed = 1; seed <= 3; ++seed) {
        SCOPED_TRACE(testing::Message() << seed << " " << LossName(loss));
        SolvedScene solved = Solve(seed, norm(), 30, baseline);
        BoundedOptions options = OptionsFor(solved, norm());
        options.loss = {loss, solved.cap / 2};
        options.gap_tolerance = 1e-6;
        options.stationarity_tolerance = 1e-8;
        const KnownRotationProblem& problem = solved.scene.problem;
        Estimate estimate = solved.scene.estimate;
        const BoundedSummary summary =
            MinimizeBounded(problem, options, {}, &estimate);
        EXPECT_EQ(summary.termination, InteriorPointTermination::kConverged);
        EXPECT_LT(summary.cost_final, summary.cost_initial);
        EXPECT_LT(Cost(problem, estimate, norm(), 1), solved.cap);
        FirstOrder after(problem, estimate, options.loss, solved.cap, norm());
        FirstOrder before(problem, solved.scene.estimate, options.loss,
                          solved.cap, norm());
        EXPECT_GT(after.num_active(), 0u);
        const double remains = after.Remains();
        EXPECT_LT(remains, 5e-5);
        EXPECT_LT(remains, 1e-3 * before.Remains());
      }
    }
  }
}

TEST_P(BoundedLeastSquares, KeepsEveryIterateBelowTheCap) {
  SolvedScene solved = Solve(4, norm());
  BoundedOptions options = OptionsFor(solved, norm());
  int calls = 0;
  options.callback = [&](const BoundedIterate& iterate) {
    EXPECT_EQ(iterate.iteration, ++calls);
    EXPECT_GT(iterate.step, 0);
    EXPECT_LE(iterate.step, 1);
  };
  for (int iterations = 1; iterations <= 12; ++iterations) {
    options.max_iterations = iterations;
    calls = 0;
    Estimate estimate = solved.scene.estimate;
    const BoundedSummary summary =
        MinimizeBounded(solved.scene.problem, options, {}, &estimate);
    EXPECT_EQ(summary.iterations, calls);
    EXPECT_LT(Cost(solved.scene.problem, estimate, norm(), 1), solved.cap);
  }
}

// Moves every point along a direction of its own until its largest error is
// just below the cap.
Estimate WithPointsNearTheCap(const SolvedScene& solved, Norm norm,
                              double share) {
  const KnownRotationProblem& problem = solved.scene.problem;
  Estimate estimate = solved.scene.estimate;
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    Eigen::Vector3d& point = estimate.points[k];
    const Eigen::Vector3d from = point;
    const Eigen::Vector3d direction(normal(generator), normal(generator),
                                    normal(generator));
    const auto is_below = [&](double length) {
      point = from + length * direction;
      for (const int64_t i : problem.OfPoint(k)) {
        const ViewedPoint viewed =
            ViewPoint(problem, problem.observations[i], estimate);
        if (!(ResidualOf(viewed, norm) < share * solved.cap)) return false;
      }
      return true;
    };
    double low = 0, high = 1;
    for (int n = 0; n < 50; ++n) {
      const double middle = (low + high) / 2;
      (is_below(middle) ? low : high) = middle;
    }
    point = from + low * direction;
  }
  return estimate;
}

TEST_P(BoundedLeastSquares, DoesNotDependOnWhereThePointsStartBelowTheCap) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    SolvedScene solved = Solve(seed, norm());
    const BoundedOptions options = OptionsFor(solved, norm());
    Estimate displaced = WithPointsNearTheCap(solved, norm(), 1 - 1e-6);
    const BoundedSummary far =
        MinimizeBounded(solved.scene.problem, options, {}, &displaced);
    const BoundedSummary near = MinimizeBounded(solved.scene.problem, options,
                                                {}, &solved.scene.estimate);
    EXPECT_EQ(far.termination, InteriorPointTermination::kConverged);
    EXPECT_LE(far.iterations, near.iterations + 1);
    EXPECT_NEAR(far.cost_final, near.cost_final, 1e-3 * near.cost_final);
  }
}

TEST_P(BoundedLeastSquares, LeavesFixedPointsInPlace) {
  SolvedScene solved = Solve(6, norm());
  KnownRotationProblem& problem = solved.scene.problem;
  Estimate estimate = WithPointsNearTheCap(solved, norm(), 0.9);
  const Estimate start = estimate;
  problem.fixed_points.resize(problem.num_points);
  for (int32_t k = 0; k < problem.num_points; k += 5) {
    problem.fixed_points[k] = start.points[k];
  }
  MinimizeBounded(problem, OptionsFor(solved, norm()), {}, &estimate);
  for (int32_t k = 0; k < problem.num_points; ++k) {
    SCOPED_TRACE(k);
    EXPECT_EQ(estimate.points[k] == start.points[k], k % 5 == 0);
  }
}

TEST_P(BoundedLeastSquares, HoldsTheFrameThatSeesMost) {
  // All frames see as much: the first one is held.
  SolvedScene solved = Solve(5, norm());
  Estimate estimate = solved.scene.estimate;
  MinimizeBounded(solved.scene.problem, OptionsFor(solved, norm()), {},
                  &estimate);
  EXPECT_EQ(estimate.translations[0], solved.scene.estimate.translations[0]);
}

// Two components at once: each has its own gauge.
TEST_P(BoundedLeastSquares, SolvesComponentsAsIfEachWereAlone) {
  const SolvedScene first = Solve(7, norm());
  const SolvedScene second = Solve(8, norm());
  const KnownRotationProblem& a = first.scene.problem;
  const KnownRotationProblem& b = second.scene.problem;
  KnownRotationProblem both = a;
  both.num_frames += b.num_frames;
  both.num_points += b.num_points;
  for (View view : b.views) {
    view.frame += a.num_frames;
    both.views.push_back(view);
  }
  for (Observation o : b.observations) {
    o.view += static_cast<int32_t>(a.views.size());
    o.point += a.num_points;
    both.observations.push_back(o);
  }
  IndexObservations(&both);
  Estimate estimate = first.scene.estimate;
  const Estimate& other = second.scene.estimate;
  estimate.translations.insert(estimate.translations.end(),
                               other.translations.begin(),
                               other.translations.end());
  estimate.points.insert(estimate.points.end(), other.points.begin(),
                         other.points.end());
  BoundedOptions options = OptionsFor(first, norm());
  options.cap = std::max(first.cap, second.cap);
  options.gap_tolerance = 1e-7;
  double sum = 0;
  for (SolvedScene solved : {first, second}) {
    sum += MinimizeBounded(solved.scene.problem, options, {},
                           &solved.scene.estimate)
               .cost_final;
  }
  const BoundedSummary summary = MinimizeBounded(both, options, {}, &estimate);
  EXPECT_EQ(summary.termination, InteriorPointTermination::kConverged);
  EXPECT_NEAR(summary.cost_final, sum, 1e-5 * sum);
}

TEST_P(BoundedLeastSquares, RefusesAStartThatIsNotBelowTheCap) {
  SolvedScene solved = Solve(9, norm());
  BoundedOptions options = OptionsFor(solved, norm());
  options.cap = 0.9 * solved.cap;
  EXPECT_THROW(MinimizeBounded(solved.scene.problem, options, {},
                               &solved.scene.estimate),
               std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(
    Norms, BoundedLeastSquares,
    testing::Values(1.0, 2.0, std::numeric_limits<double>::infinity()),
    [](const testing::TestParamInfo<double>& norm) {
      return std::isinf(norm.param)
                 ? std::string("Inf")
                 : std::to_string(static_cast<int>(norm.param));
    });

TEST(ErrorLoss, WeighsAsItsDerivativeSays) {
  for (const ErrorLoss::Kind kind :
       {ErrorLoss::Kind::kTrivial, ErrorLoss::Kind::kHuber,
        ErrorLoss::Kind::kCauchy}) {
    const ErrorLoss loss{kind, 1.5};
    for (const double s : {0.1, 1.0, 2.0, 5.0, 100.0}) {
      const double h = 1e-6 * s;
      EXPECT_NEAR(loss.Weight(s),
                  (loss.Value(s + h) - loss.Value(s - h)) / (2 * h), 1e-8);
    }
  }
}

}  // namespace
}  // namespace krot::internal
