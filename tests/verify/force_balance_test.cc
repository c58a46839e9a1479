#include "krot/verify/force_checker.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include <gtest/gtest.h>

#include "krot/problem/subset.h"
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

}  // namespace
}  // namespace krot::internal
