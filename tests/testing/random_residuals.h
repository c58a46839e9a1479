#pragma once

#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "krot/minimax/residual_set.h"

namespace krot::internal {

// Random problems (1) of the two kinds that sweeps meet, about 8 units large.
struct ResidualProblem {
  std::vector<Residual> residuals;
  Eigen::Vector3d x_true = Eigen::Vector3d::Zero();  // without noise, optimal

  double Cost(const Eigen::Vector3d& x, Norm norm) const {
    double cost = 0;
    for (const Residual& residual : residuals) {
      cost = std::max(cost, ResidualValue(residual, x, norm));
    }
    return cost;
  }
};

class ProblemGenerator {
 public:
  explicit ProblemGenerator(unsigned seed) : generator_(seed) {}

  double Normal() { return normal_(generator_); }
  double Uniform() { return uniform_(generator_); }
  Eigen::Vector3d Normal3() { return {Normal(), Normal(), Normal()}; }

  // A camera at `center` that looks roughly at the origin.
  Eigen::Matrix3d RotationTowardsOrigin(const Eigen::Vector3d& center) {
    Eigen::Matrix3d R;
    R.row(2) = (-center + 0.5 * Normal3()).normalized();
    R.row(0) = Normal3().cross(Eigen::Vector3d(R.row(2))).normalized();
    R.row(1) = Eigen::Vector3d(R.row(2)).cross(Eigen::Vector3d(R.row(0)));
    return R;
  }

  // The unknown is a point that a camera at `center` observes with noise.
  Residual Ray(const Eigen::Vector3d& x_true, const Eigen::Vector3d& center,
               double noise_px) {
    const Eigen::Matrix3d R = RotationTowardsOrigin(center);
    return FromCamera(R, -R * center, x_true, noise_px);
  }

  ResidualProblem Triangulation(int num_rays, double noise_px) {
    ResidualProblem problem;
    problem.x_true = Normal3();
    for (int i = 0; i < num_rays; ++i) {
      const Eigen::Vector3d center =
          (5 + 3 * Uniform()) * Normal3().normalized();
      problem.residuals.push_back(Ray(problem.x_true, center, noise_px));
    }
    return problem;
  }

  // The unknown is a translation; every observation has its own point, but
  // all share one rotation (here I), so c is the same for all.
  ResidualProblem Resection(int num_points, double noise_px) {
    ResidualProblem problem;
    problem.x_true = Normal3();
    for (int i = 0; i < num_points; ++i) {
      const Eigen::Vector3d x_cam(3 * Normal(), 3 * Normal(),
                                  4 + 8 * Uniform());
      problem.residuals.push_back(FromCamera(Eigen::Matrix3d::Identity(),
                                             x_cam - problem.x_true,
                                             problem.x_true, noise_px));
    }
    return problem;
  }

  // A start with positive depths, about `distance` from the truth.
  Eigen::Vector3d Start(const ResidualProblem& problem, double distance) {
    for (;; distance *= 0.9) {
      const Eigen::Vector3d x = problem.x_true + distance * Normal3();
      if (std::isfinite(problem.Cost(x, Norm::L2()))) return x;
    }
  }

 private:
  // x_cam = R x + o, focal lengths near 1000 px, a little skew.
  Residual FromCamera(const Eigen::Matrix3d& R, const Eigen::Vector3d& o,
                      const Eigen::Vector3d& x_true, double noise_px) {
    Eigen::Matrix2d J;
    J << 1000 + 50 * Normal(), 20 * Normal(), 20 * Normal(),
        1000 + 50 * Normal();
    const Eigen::Vector2d u =
        (R * x_true + o).hnormalized() +
        noise_px / 1000 * Eigen::Vector2d(Normal(), Normal());
    Eigen::Matrix<double, 2, 3> E;
    E << J, -J * u;
    return {E * R, E * o, R.row(2), o[2]};
  }

  std::mt19937 generator_;
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_;
};

inline void Fill(const ResidualProblem& problem, ResidualSet* residuals) {
  residuals->Clear();
  for (const Residual& residual : problem.residuals) residuals->Add(residual);
}

}  // namespace krot::internal
