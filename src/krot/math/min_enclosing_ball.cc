#include "krot/minimax.h"

#include <algorithm>
#include <limits>
#include <optional>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/base/check.h"

namespace krot {

using namespace internal;

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// A point that is outside a ball by less than this, relative to the radius,
// counts as being on it.
constexpr double kRadiusRounding = 1e-12;

bool Holds(const Ball& ball, const Vector3d* points, int count) {
  for (int i = 0; i < count; ++i) {
    if (!((points[i] - ball.center).norm() <=
          ball.radius * (1 + kRadiusRounding) +
              std::numeric_limits<double>::min())) {
      return false;
    }
  }
  return true;
}

// Case 2: a diameter.
Ball OfTwo(const Vector3d& p0, const Vector3d& p1) {
  const Vector3d center = 0.5 * (p0 + p1);
  return {center, (center - p0).norm()};
}

// Case 3.2: the circle through three points, a great circle of the ball.
std::optional<Ball> ThroughThree(const Vector3d& p0, const Vector3d& p1,
                                 const Vector3d& p2) {
  const Vector3d a = p1 - p0;
  const Vector3d b = p2 - p0;
  const Vector3d n = a.cross(b);
  const double nn = n.squaredNorm();
  if (!(nn > 0)) return std::nullopt;  // collinear
  const Vector3d offset =
      (a.squaredNorm() * b.cross(n) + b.squaredNorm() * n.cross(a)) / (2 * nn);
  return Ball{p0 + offset, offset.norm()};
}

// Case 4.2: the sphere through four points. (For unit vectors the centre is
// the origin.)
std::optional<Ball> ThroughFour(const Vector3d* p) {
  Matrix3d M;
  Vector3d rhs;
  for (int i = 0; i < 3; ++i) {
    const Vector3d side = p[i + 1] - p[0];
    M.row(i) = side;
    rhs[i] = 0.5 * side.squaredNorm();
  }
  const Eigen::FullPivLU<Matrix3d> lu(M);
  if (!lu.isInvertible()) return std::nullopt;  // coplanar
  const Vector3d offset = lu.solve(rhs);
  return Ball{p[0] + offset, offset.norm()};
}

}  // namespace

Ball MinEnclosingBall(const Vector3d* points, int count) {
  CheckArgument(count >= 1 && count <= 4, "count", count, "1 to 4");
  if (count == 1) return {points[0], 0};  // case 1
  Ball best{Vector3d::Zero(), std::numeric_limits<double>::infinity()};
  const auto keep_if_smallest = [&](const std::optional<Ball>& ball) {
    if (ball && ball->radius < best.radius && Holds(*ball, points, count)) {
      best = *ball;
    }
  };
  for (int i = 0; i < count; ++i) {
    for (int j = i + 1; j < count; ++j) {
      keep_if_smallest(OfTwo(points[i], points[j]));  // cases 2, 3.1, 4.1
      for (int k = j + 1; k < count; ++k) {
        keep_if_smallest(ThroughThree(points[i], points[j], points[k]));
      }
    }
  }
  if (count == 4) keep_if_smallest(ThroughFour(points));
  // If points nearly coincide, rounding may make all candidates fail.
  if (!(best.radius < std::numeric_limits<double>::infinity())) {
    best.center.setZero();
    for (int i = 0; i < count; ++i) best.center += points[i] / count;
    best.radius = 0;
    for (int i = 0; i < count; ++i) {
      best.radius = std::max(best.radius, (points[i] - best.center).norm());
    }
  }
  return best;
}

}  // namespace krot
