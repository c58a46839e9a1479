#include "tools/benchmark/subproblem.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Dense>

#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMaxPairs = 50;
constexpr double kSmallestSine = 8.7e-3;  // of half a degree

Residual FromRow(const double row[kResidualRow]) {
  Residual residual;
  residual.A << row[0], row[1], row[2], row[4], row[5], row[6];
  residual.b << row[3], row[7];
  residual.c << row[8], row[9], row[10];
  residual.d = row[11];
  return residual;
}

// The equations v = 0, scaled so that |A x + b| is the distance of x from the
// ray.
void NormalizeRay(const Residual& residual,
                  Eigen::Ref<Eigen::Matrix<double, 2, 3>> A,
                  Eigen::Ref<Vector2d> b) {
  const Eigen::Matrix2d L =
      (residual.A * residual.A.transpose()).llt().matrixL();
  A = L.triangularView<Eigen::Lower>().solve(residual.A);
  b = L.triangularView<Eigen::Lower>().solve(residual.b);
}

// Changes the unit of length, x -> x / unit; the residuals' values stay.
void Rescale(double unit, Subproblem* problem) {
  for (Residual& residual : problem->residuals) {
    residual.b /= unit;
    residual.d /= unit;
  }
  problem->start /= unit;
}

double MeanDepth(const Subproblem& problem) {
  double sum = 0;
  for (const Residual& residual : problem.residuals) {
    sum += residual.Depth(problem.start);
  }
  return sum / static_cast<double>(problem.residuals.size());
}

}  // namespace

double Subproblem::Cost(const Vector3d& x, Norm norm) const {
  double cost = 0;
  for (const Residual& residual : residuals) {
    cost = std::max(cost, ResidualValue(residual, x, norm));
  }
  return cost;
}

std::optional<Vector3d> MidPoint(const Residual& a, const Residual& b) {
  Eigen::Matrix<double, 4, 3> A;
  Eigen::Vector4d rhs;
  NormalizeRay(a, A.topRows<2>(), rhs.head<2>());
  NormalizeRay(b, A.bottomRows<2>(), rhs.tail<2>());
  const Matrix3d normal = A.transpose() * A;
  // The eigenvalues are 2 and 1 +- the cosine of the rays' angle.
  const double sine_squared = normal.determinant() / 2;
  if (!(sine_squared > kSmallestSine * kSmallestSine)) return std::nullopt;
  return normal.llt().solve(-A.transpose() * rhs);
}

std::optional<Subproblem> MakeTriangulation(std::vector<Residual> residuals,
                                            Random* random) {
  Subproblem problem;
  problem.residuals = std::move(residuals);
  const int64_t count = static_cast<int64_t>(problem.residuals.size());
  if (count < 2) return std::nullopt;
  for (int pair = 0; pair < kMaxPairs; ++pair) {
    const int64_t i = random->UniformInt(count);
    const int64_t j = (i + 1 + random->UniformInt(count - 1)) % count;
    const std::optional<Vector3d> middle =
        MidPoint(problem.residuals[i], problem.residuals[j]);
    if (!middle || !std::isfinite(problem.Cost(*middle, Norm::L2()))) continue;
    problem.start = *middle;
    Rescale(MeanDepth(problem), &problem);
    return problem;
  }
  return std::nullopt;
}

std::vector<Residual> IntersectionResiduals(const KnownRotationProblem& problem,
                                            const Estimate& estimate,
                                            int32_t point) {
  std::vector<Residual> residuals;
  for (int64_t i = problem.point_begin[point];
       i < problem.point_begin[point + 1]; ++i) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    double row[kResidualRow];
    AffineRow(CamFromWorld(view, estimate.translations[view.frame]),
              observation, row);
    residuals.push_back(FromRow(row));
  }
  return residuals;
}

std::vector<Residual> ResectionResiduals(const KnownRotationProblem& problem,
                                         const Estimate& estimate,
                                         int32_t frame) {
  std::vector<Residual> residuals;
  for (int64_t n = problem.frame_begin[frame];
       n < problem.frame_begin[frame + 1]; ++n) {
    const Observation& observation =
        problem.observations[problem.frame_observations[n]];
    double row[kResidualRow];
    ResectionRow(problem.views[observation.view], observation,
                 estimate.points[observation.point], row);
    residuals.push_back(FromRow(row));
  }
  return residuals;
}

std::optional<Subproblem> MakeBlock(std::vector<Residual> residuals,
                                    const Vector3d& start) {
  Subproblem problem{std::move(residuals), start};
  const bool is_determined = std::any_of(
      problem.residuals.begin(), problem.residuals.end(),
      [&](const Residual& residual) {
        return MidPoint(problem.residuals.front(), residual).has_value();
      });
  if (!is_determined || !std::isfinite(problem.Cost(start, Norm::L2()))) {
    return std::nullopt;
  }
  Rescale(MeanDepth(problem), &problem);
  return problem;
}

std::vector<Residual> RandomTriangulation(int num_cameras, double sigma,
                                          Random* random) {
  constexpr double kFocalLength = 1000;  // pixels
  const Vector3d x_world = random->GaussianVector();
  std::vector<Residual> residuals;
  while (static_cast<int>(residuals.size()) < num_cameras) {
    const Vector3d center =
        random->Uniform(5, 8) * random->GaussianVector().normalized();
    Matrix3d R;  // world to camera; rows are the camera's axes
    R.row(2) = (-center + 0.5 * random->GaussianVector()).normalized();
    R.row(0) = random->GaussianVector().cross(Vector3d(R.row(2))).normalized();
    R.row(1) = Vector3d(R.row(2)).cross(Vector3d(R.row(0)));
    const Vector3d t = -R * center;
    const Vector3d x_cam = R * x_world + t;
    if (!(x_cam[2] > 0.5)) continue;
    const Vector2d noise(random->Gaussian(), random->Gaussian());
    const Vector2d u = x_cam.hnormalized() + sigma / kFocalLength * noise;
    Eigen::Matrix<double, 2, 3> J;               // J (I2 | -u)
    J << kFocalLength, 0, -kFocalLength * u[0],  //
        0, kFocalLength, -kFocalLength * u[1];
    residuals.push_back({J * R, J * t, R.row(2), t[2]});
  }
  return residuals;
}

}  // namespace krot::internal
