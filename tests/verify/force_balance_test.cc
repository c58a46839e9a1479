#include "krot/verify/force_checker.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/problem/subset.h"
#include "krot/verify/certificate_check.h"
#include "tests/joint/small_scenes.h"
#include "tests/oracle/dense_algebra.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

using Real = long double;

int32_t FrameNode(const KnownRotationProblem& problem, int64_t i) {
  return problem.num_points + problem.views[problem.observations[i].view].frame;
}

// The sum of forces at every node: points first, then frames.
Eigen::MatrixXd Incidence(const KnownRotationProblem& problem) {
  Eigen::MatrixXd incidence =
      Eigen::MatrixXd::Zero(problem.num_points + problem.num_frames,
                            static_cast<int64_t>(problem.observations.size()));
  for (int64_t i = 0; i < incidence.cols(); ++i) {
    incidence(problem.observations[i].point, i) = 1;
    incidence(FrameNode(problem, i), i) = 1;
  }
  return incidence;
}

std::vector<Real> RandomStrengths(size_t count) {
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> decades(-8, 0);
  std::vector<Real> strengths(count);
  for (Real& s : strengths) s = std::pow(10, decades(generator));
  return strengths;
}

// Of two components.
KnownRotationProblem MakeProblem() {
  return Glue(MakeSmallScene(1), MakeSmallScene(2)).problem;
}

TEST(BoundCorrections, LeadToWhatIsFixed) {
  KnownRotationProblem problem = MakeSmallScene(1).problem;
  problem.fixed_translations.resize(problem.num_frames);
  problem.fixed_translations[1] = Eigen::Vector3d::Zero();
  problem.fixed_points.resize(problem.num_points);
  problem.fixed_points[2] = Eigen::Vector3d::Zero();
  // A force at each of the two, where any is taken, and at one other point.
  Imbalance imbalance{std::vector<Real>(problem.num_points, 0),
                      std::vector<Real>(problem.num_frames, 0)};
  imbalance.of_frame[1] = imbalance.of_point[2] = 100;
  imbalance.of_point[0] = 1;
  Real sum = 0;
  for (const Real bound : BoundCorrections(
           problem, RandomStrengths(problem.observations.size()), imbalance)) {
    EXPECT_LT(bound, 1.1);
    sum += bound;
  }
  EXPECT_GT(sum, 0.9);
}

TEST(BoundCorrections, LeavesRoomToBalanceWhateverForces) {
  const KnownRotationProblem problem = MakeProblem();
  const Eigen::MatrixXd incidence = Incidence(problem);
  const Eigen::MatrixX3d g =
      incidence * Eigen::MatrixX3d::Random(incidence.cols(), 3);
  Imbalance imbalance;
  for (int64_t node = 0; node < g.rows(); ++node) {
    (node < problem.num_points ? imbalance.of_point : imbalance.of_frame)
        .push_back(g.row(node).norm());
  }
  const std::vector<Real> bounds = BoundCorrections(
      problem, RandomStrengths(problem.observations.size()), imbalance);

  // Where corrections are allowed there are no cycles, so they are unique.
  std::vector<int64_t> allowed;
  for (size_t i = 0; i < bounds.size(); ++i) {
    if (bounds[i] > 0) allowed.push_back(static_cast<int64_t>(i));
  }
  ASSERT_EQ(allowed.size(), g.rows() - 2u);
  Eigen::MatrixXd forest(g.rows(), allowed.size());
  for (size_t n = 0; n < allowed.size(); ++n) {
    forest.col(static_cast<int64_t>(n)) = incidence.col(allowed[n]);
  }
  const Eigen::MatrixX3d corrections =
      LeastNormSolution(forest.cast<long double>(), -g.cast<long double>())
          .cast<double>();
  EXPECT_LE((forest * corrections + g).norm(), 1e-12 * g.norm());
  for (size_t n = 0; n < allowed.size(); ++n) {
    EXPECT_LE(corrections.row(static_cast<int64_t>(n)).norm(),
              static_cast<double>(bounds[allowed[n]]) * (1 + 1e-12));
  }
}

// The strongest way between any two nodes, by Floyd and Warshall.
Eigen::MatrixXd WidestWays(const KnownRotationProblem& problem,
                           const std::vector<Real>& strengths,
                           const std::vector<char>& is_allowed) {
  const int count = problem.num_points + problem.num_frames;
  Eigen::MatrixXd width = Eigen::MatrixXd::Zero(count, count);
  for (size_t i = 0; i < strengths.size(); ++i) {
    if (!is_allowed[i]) continue;
    const int32_t point = problem.observations[i].point;
    const int32_t frame = FrameNode(problem, static_cast<int64_t>(i));
    const double widest =
        std::max(width(point, frame), static_cast<double>(strengths[i]));
    width(point, frame) = width(frame, point) = widest;
  }
  for (int k = 0; k < count; ++k) {
    for (int a = 0; a < count; ++a) {
      for (int b = 0; b < count; ++b) {
        width(a, b) = std::max(width(a, b), std::min(width(a, k), width(k, b)));
      }
    }
  }
  return width;
}

// What the two ends of a component's strongest observation miss goes no farther
// than along it, and what others miss comes to its frame.
TEST(BoundCorrections, LeadToTheFrameOfEachComponentsStrongestObservation) {
  const KnownRotationProblem problem = MakeProblem();
  const std::vector<Real> strengths =
      RandomStrengths(problem.observations.size());
  for (const std::vector<int64_t>& component : SplitIntoComponents(problem)) {
    const int64_t strongest = *std::max_element(
        component.begin(), component.end(),
        [&](int64_t a, int64_t b) { return strengths[a] < strengths[b]; });
    const Observation& observation = problem.observations[strongest];
    const int32_t frame = problem.views[observation.view].frame;
    const auto sum = [&](int32_t point_that_misses, int32_t frame_that_misses) {
      Imbalance imbalance{std::vector<Real>(problem.num_points, 0),
                          std::vector<Real>(problem.num_frames, 0)};
      if (point_that_misses >= 0) imbalance.of_point[point_that_misses] = 1;
      if (frame_that_misses >= 0) imbalance.of_frame[frame_that_misses] = 1;
      const std::vector<Real> bounds =
          BoundCorrections(problem, strengths, imbalance);
      return std::accumulate(bounds.begin(), bounds.end(), Real{0});
    };
    EXPECT_EQ(sum(-1, frame), 0);
    EXPECT_NEAR(static_cast<double>(sum(observation.point, -1)), 1, 1e-8);
    for (const int64_t i : component) {
      const int32_t other = problem.views[problem.observations[i].view].frame;
      if (other == frame) continue;
      EXPECT_GE(sum(-1, other), 2);
    }
  }
}

TEST(BoundCorrections, SendsForcesAlongTheStrongestWays) {
  const KnownRotationProblem problem = MakeProblem();
  const std::vector<Real> strengths =
      RandomStrengths(problem.observations.size());
  const std::vector<Real> bounds =
      BoundCorrections(problem, strengths,
                       {std::vector<Real>(problem.num_points, 1),
                        std::vector<Real>(problem.num_frames, 1)});
  std::vector<char> is_in_forest;
  for (const Real bound : bounds) is_in_forest.push_back(bound > 0);
  EXPECT_EQ(
      WidestWays(problem, strengths, is_in_forest),
      WidestWays(problem, strengths, std::vector<char>(strengths.size(), 1)));
}

using Real = ObservationForce::Real;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;
using Vector3 = ObservationForce::Vector3;

constexpr Real kUnit = std::numeric_limits<Real>::epsilon() / 2;

TEST(ObservationForce, IsTheSumOfTheRowsTimesTheMultipliers) {
  Observation observation;
  observation.E << 1, -2, 3, -4, 5, -6, 7, 8, -9;
  const ObservationForce force = MakeForce(observation, {-10, 100}, 1000);
  EXPECT_EQ(force.sum,
            Vector3(1000 + 40 + 700, -2000 - 50 + 800, 3000 + 60 - 900));
  EXPECT_EQ(force.terms,
            Vector3(1000 + 40 + 700, 2000 + 50 + 800, 3000 + 60 + 900));
}

TEST(RoundingError, CoversTwelveRoundingsOfEachTermAndOneOfEachSum) {
  for (const size_t count : {1, 2, 3, 10, 1000, 1000000}) {
    const Real all =
        std::expm1((12 + static_cast<Real>(count)) * std::log1p(kUnit));
    EXPECT_GE(RoundingError(count), all);
    EXPECT_LE(RoundingError(count), 2 * all);
  }
}

// Each of the terms is less than what the sum rounds to.
TEST(RoundingError, CoversASumThatLosesAllTermsButTheFirst) {
  const int count = 1000;
  const Real lost = 0.99L * kUnit;
  Real sum = 1;
  for (int n = 1; n < count; ++n) sum += lost;
  ASSERT_EQ(sum, 1);
  EXPECT_GE(RoundingError(count), (count - 1) * lost);
}

TEST(ForceError, CoversWhateverMatrixIsAsNear) {
  for (const size_t count : {1, 1000, 100000000}) {
    const Real entry = kRotationError + RoundingError(count);
    EXPECT_GE(ForceError(count), Vector3::Constant(entry).norm());
    EXPECT_LE(ForceError(count), 2 * entry);
  }
}

// Of rows whose lengths differ by ten decades, in any unit, by the inverse, and
// outwards by a billionth.
TEST(Compliance, IsWhatTheRowsOfTheInverseAreLong) {
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 200; ++n) {
    Observation observation;
    for (double& entry : observation.E.reshaped()) entry = normal(generator);
    observation.E.row(n % 3) *= 1e10;
    observation.E *= std::pow(10, n % 7 - 10);
    const Matrix3 rows =
        Matrix3(observation.E.cast<Real>()).inverse().transpose();
    const std::optional<Compliance> compliance = MakeCompliance(observation);
    ASSERT_TRUE(compliance);
    const Real y = rows.bottomRows<2>().norm();
    const Real depth = rows.row(0).norm();
    EXPECT_GE(compliance->y, y);
    EXPECT_LE(compliance->y, y * (1 + 2e-9L));
    EXPECT_GE(compliance->delta_lambda, depth);
    EXPECT_LE(compliance->delta_lambda, depth * (1 + 2e-9L));
  }
}

Eigen::Vector3d RandomIntegers(int bits, std::mt19937_64* generator) {
  std::uniform_int_distribution<int64_t> integer(1, int64_t{1} << bits);
  return Eigen::Vector3d::NullaryExpr(
      [&] { return static_cast<double>(integer(*generator)); });
}

// Rows a and a + s have a x (a + s) = a x s, which does without the difference
// of numbers that nearly agree.
TEST(Compliance, CoversItsRoundingWhereRowsNearlyDepend) {
  std::mt19937_64 generator(4);
  for (int n = 0; n < 200; ++n) {
    const Eigen::Vector3d a = RandomIntegers(50, &generator);
    const Eigen::Vector3d s = RandomIntegers(5, &generator);
    const Eigen::Vector3d b = RandomIntegers(50, &generator);
    Observation observation;
    observation.E << b.transpose(), a.transpose(), (a + s).transpose();
    const std::optional<Compliance> compliance = MakeCompliance(observation);
    ASSERT_TRUE(compliance);
    const Vector3 across =
        Vector3(a.cast<Real>()).cross(Vector3(s.cast<Real>()));
    const Real det = std::abs(across.dot(b.cast<Real>()));
    const Vector3 of_a = Vector3(b.cast<Real>()).cross(Vector3(a.cast<Real>()));
    EXPECT_GE(compliance->delta_lambda, across.norm() / det);
    EXPECT_GE(compliance->y,
              (1 - 1e-12L) * std::sqrt(2.0L) * of_a.norm() / det);
    EXPECT_LE(compliance->y, (1 + 0.1L) * std::sqrt(2.0L) * of_a.norm() / det);
  }
}

TEST(Compliance, IsNoneWhereRowsDepend) {
  std::mt19937_64 generator(5);
  for (int n = 0; n < 200; ++n) {
    const Eigen::Vector3d a = RandomIntegers(50, &generator);
    const Eigen::Vector3d b = RandomIntegers(50, &generator);
    Observation observation;
    observation.E << a.transpose(), b.transpose(), (a + b).transpose();
    observation.E *= std::ldexp(1, 10 * (n % 13 - 10));
    EXPECT_FALSE(MakeCompliance(observation));
  }
}

TEST(Compliance, IsNoneOfWhatIsNoNumber) {
  for (const double entry : {0.0, double{INFINITY}, double{NAN}}) {
    for (int row = 0; row < 3; ++row) {
      Observation observation;
      observation.E.setIdentity();
      observation.E.row(row).setConstant(entry);
      EXPECT_FALSE(MakeCompliance(observation));
    }
  }
}

}  // namespace
}  // namespace krot::internal
