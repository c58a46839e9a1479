// The true optimum of small models by another way: a smooth stand-in for the
// largest error is minimised by quasi-Newton steps with numeric derivatives
// from many starts; nothing of the rows, cones and rounds.

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "krot/base/numbers.h"
#include "krot/convert/reprojection.h"
#include "krot/pipeline/solve_model.h"
#include "tests/convert/lens_model.h"

namespace krot::internal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class BruteForce {
 public:
  explicit BruteForce(const Model& model)
      : built_(BuildProblem(model, {})), reprojection_(model, built_) {}

  // All translations but the first, then all points: the origin is fixed, and
  // so nearly is the scale, by steps that are not taken along it.
  VectorXd Start() const {
    VectorXd x(3 * (built_.problem.num_frames - 1 + built_.problem.num_points));
    int at = 0;
    for (int f = 1; f < built_.problem.num_frames; ++f, at += 3) {
      x.segment<3>(at) = built_.start.translations[f];
    }
    for (const Eigen::Vector3d& point : built_.start.points) {
      x.segment<3>(at) = point;
      at += 3;
    }
    return x;
  }

  double LargestError(const VectorXd& x) const {
    return reprojection_.TrueCost(EstimateOf(x), Norm::L2(), 1);
  }

  // The largest error of a local minimum near x.
  double Descend(VectorXd x) const {
    double lowest = LargestError(x);
    for (double sharpness = 2; sharpness < 3000; sharpness *= 3) {
      x = Minimize(x, sharpness);
      lowest = std::min(lowest, LargestError(x));
    }
    return lowest;
  }

 private:
  Estimate EstimateOf(const VectorXd& x) const {
    Estimate estimate = built_.start;
    int at = 0;
    for (int f = 1; f < built_.problem.num_frames; ++f, at += 3) {
      estimate.translations[f] = x.segment<3>(at);
    }
    for (Eigen::Vector3d& point : estimate.points) {
      point = x.segment<3>(at);
      at += 3;
    }
    return estimate;
  }

  VectorXd Errors(const Estimate& estimate) const {
    VectorXd errors(built_.pixels.size());
    for (int i = 0; i < errors.size(); ++i) {
      errors[i] = reprojection_.Error(estimate, Norm::L2(), i);
    }
    return errors;
  }

  // log(sum exp(sharpness e_i)) / sharpness: at most log(n) / sharpness above
  // the largest error.
  double Smooth(const VectorXd& x, double sharpness) const {
    const VectorXd errors = Errors(EstimateOf(x));
    const double largest = errors.maxCoeff();
    if (!std::isfinite(largest)) return kInfinity;
    return largest +
           std::log((sharpness * (errors.array() - largest)).exp().sum()) /
               sharpness;
  }

  // By differences of every error in its own six unknowns.
  VectorXd Gradient(const VectorXd& x, double sharpness) const {
    constexpr double kStep = 1e-7;
    constexpr double kSmallestWeight = 1e-12;
    Estimate estimate = EstimateOf(x);
    const VectorXd errors = Errors(estimate);
    VectorXd weights = (sharpness * (errors.array() - errors.maxCoeff())).exp();
    weights /= weights.sum();
    VectorXd gradient = VectorXd::Zero(x.size());
    for (int i = 0; i < errors.size(); ++i) {
      if (weights[i] < kSmallestWeight) continue;
      const auto add = [&](Eigen::Vector3d* unknown, int at) {
        for (int k = 0; k < 3; ++k) {
          double& value = (*unknown)[k];
          const double middle = value;
          value = middle + kStep;
          const double ahead = reprojection_.Error(estimate, Norm::L2(), i);
          value = middle - kStep;
          const double behind = reprojection_.Error(estimate, Norm::L2(), i);
          value = middle;
          gradient[at + k] += weights[i] * (ahead - behind) / (2 * kStep);
        }
      };
      const KnownRotationProblem& problem = built_.problem;
      const Observation& observation = problem.observations[i];
      const int f = problem.views[observation.view].frame;
      if (f > 0) add(&estimate.translations[f], 3 * (f - 1));
      add(&estimate.points[observation.point],
          3 * (problem.num_frames - 1 + observation.point));
    }
    return gradient;
  }

  // BFGS with backtracking.
  VectorXd Minimize(VectorXd x, double sharpness) const {
    const auto size = x.size();
    MatrixXd inverse = 1e-6 * MatrixXd::Identity(size, size);
    double value = Smooth(x, sharpness);
    VectorXd gradient = Gradient(x, sharpness);
    for (int iteration = 0; iteration < 150; ++iteration) {
      const VectorXd direction = -(inverse * gradient);
      const double slope = direction.dot(gradient);
      if (!(slope < 0)) break;
      double step = 1;
      VectorXd trial = x + direction;
      double trial_value = Smooth(trial, sharpness);
      while (!(trial_value <= value + 1e-4 * step * slope) && step > 1e-10) {
        step /= 2;
        trial = x + step * direction;
        trial_value = Smooth(trial, sharpness);
      }
      if (!(trial_value < value)) break;
      const VectorXd trial_gradient = Gradient(trial, sharpness);
      if (!trial_gradient.allFinite()) break;
      const VectorXd s = trial - x;
      const VectorXd y = trial_gradient - gradient;
      const double sy = s.dot(y);
      if (sy > 1e-14) {
        const VectorXd by = inverse * y;
        inverse += (1 + y.dot(by) / sy) / sy * s * s.transpose() -
                   (by * s.transpose() + s * by.transpose()) / sy;
      }
      const bool is_done = value - trial_value < 1e-9 * value;
      x = trial;
      value = trial_value;
      gradient = trial_gradient;
      if (is_done) break;
    }
    return x;
  }

  const BuiltProblem built_;
  const Reprojection reprojection_;
};

struct Trial {
  const char* name;
  int camera_model_id;
  std::vector<double> params;
  int num_images;
  int num_points;
};

class BruteForceOf : public ::testing::TestWithParam<Trial> {};

INSTANTIATE_TEST_SUITE_P(
    StrongLenses, BruteForceOf,
    ::testing::Values(Trial{"Radial2x6", 2, {500, 320, 240, -0.12}, 2, 6},
                      Trial{"Radial4x5", 2, {400, 320, 240, -0.1}, 4, 5},
                      Trial{"Barrel3x8", 2, {300, 320, 240, 0.4}, 3, 8},
                      Trial{"Fisheye3x6", 8, {300, 320, 240, -0.05}, 3, 6},
                      Trial{"Kannala2x20",
                            5,
                            {300, 310, 320, 240, -0.03, 0.01, -0.004, 0.001},
                            2,
                            20}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_P(BruteForceOf, IsNeverBelowTheBoundAndReachesWhatRoundsReach) {
  LensModelOptions scene;
  scene.camera_model_id = GetParam().camera_model_id;
  scene.params = GetParam().params;
  scene.num_images = GetParam().num_images;
  scene.num_points = GetParam().num_points;
  const Model model = MakeLensModel(scene);
  const SolveSummary summary = SolveModel(model, {}).summary;
  ASSERT_TRUE(summary.is_certified);

  const BruteForce brute_force(model);
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  double lowest = kInfinity;
  for (const double disturbance : {0.0, 0.01, 0.05, 0.2, 0.5}) {
    VectorXd start = brute_force.Start();
    do {
      start = brute_force.Start();
      for (double& value : start) value += disturbance * normal(generator);
    } while (!std::isfinite(brute_force.LargestError(start)));
    lowest = std::min(lowest, brute_force.Descend(start));
  }
  EXPECT_GE(lowest, *summary.lower_bound);
  EXPECT_GE(lowest, 0.99 * summary.cost_final);
  EXPECT_LE(lowest, 1.01 * summary.cost_final);
}

}  // namespace
}  // namespace krot::internal
