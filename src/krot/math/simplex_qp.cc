#include "krot/math/simplex_qp.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/base/check.h"
#include "krot/minimax.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// Pieces whose gradients are closer than this to the affine hull of others,
// relative to the largest gradient, count as affinely dependent on them.
constexpr double kDependence = 1e-10;

// The active pieces of a solution, with the affine hull of their gradients,
// g_0 + range(D). D = Q U by Gram-Schmidt, where Q has orthogonal columns and U
// is unit upper triangular. After a change, the columns of leading pieces that
// stay active are kept.
class ActiveSet {
 public:
  // `scale` is the length of the largest gradient.
  ActiveSet(const LinearPiece* pieces, double scale,
            SimplexQpSolution* solution)
      : pieces_(pieces),
        smallest_squared_(kDependence * scale * kDependence * scale),
        active_(*solution) {}

  // Moves the weights to the minimiser on the convex hull of the active pieces,
  // dropping pieces whose weights vanish on the way.
  void Minimize() {
    while (active_.size > 1) {
      if (!CompleteHull()) {
        GiveUpLast();  // dependent, by rounding only
        continue;
      }
      double direction[4];
      Barycentric(minimizer_, direction);
      for (int k = 0; k < active_.size; ++k) direction[k] -= active_.weight[k];
      const int size = active_.size;
      MoveWeights(direction, /*limit=*/1);
      if (active_.size == size) return;
    }
    active_.weight[0] = 1;
  }

  // Adds piece j. If its gradient depends on the others, it replaces the piece
  // whose weight vanishes first as the weight of j grows. Returns false if no
  // weight vanishes, which only rounding could cause.
  bool Add(int j) {
    const Coordinates column = CoordinatesOf(pieces_[j].gradient);
    const int k = active_.size;
    if (k < 4) {
      active_.index[k] = j;
      active_.weight[k] = 0;
      if (AppendColumn(column)) {
        ++active_.size;
        return true;
      }
    }
    double direction[4];
    Barycentric(column.y, direction);
    for (int m = 0; m < active_.size; ++m) direction[m] = -direction[m];
    const double step =
        MoveWeights(direction, std::numeric_limits<double>::infinity());
    if (!std::isfinite(step) || active_.size == 4) return false;
    active_.index[active_.size] = j;
    active_.weight[active_.size] = step;
    ++active_.size;
    return true;
  }

  void SetStepAndLevel() {
    active_.step.setZero();
    for (int k = 0; k < active_.size; ++k) {
      active_.step -= active_.weight[k] * Gradient(k);
    }
    active_.level = 0;  // the weighted mean, as all values are equal there
    for (int k = 0; k < active_.size; ++k) {
      active_.level += active_.weight[k] * (pieces_[active_.index[k]].value +
                                            Gradient(k).dot(active_.step));
    }
  }

 private:
  // g - g_0 = Q y + rest.
  struct Coordinates {
    double y[3] = {};
    Vector3d rest;
  };

  const Vector3d& Gradient(int k) const {
    return pieces_[active_.index[k]].gradient;
  }
  Coordinates CoordinatesOf(const Vector3d& g) const {
    Coordinates result;
    result.rest = g - Gradient(0);
    for (int m = 0; m < rank_; ++m) {
      result.y[m] = Q_[m].dot(result.rest) * inverse_squared_[m];
      result.rest -= result.y[m] * Q_[m];
    }
    return result;
  }

  // Appends the next piece's column; returns false if it depends on the others.
  // The QP on the hull, D'D nu = delta - D'g_0 with delta the differences of
  // the values, is diagonal in y = U nu.
  bool AppendColumn(const Coordinates& column) {
    const double squared = column.rest.squaredNorm();
    if (!(squared > smallest_squared_)) return false;
    const int m = rank_++;
    Q_[m] = column.rest;
    inverse_squared_[m] = 1 / squared;
    z_[m] =
        pieces_[active_.index[m + 1]].value - pieces_[active_.index[0]].value;
    for (int k = 0; k < m; ++k) {
      U_[k][m] = column.y[k];
      z_[m] -= U_[k][m] * z_[k];
    }
    minimizer_[m] = (z_[m] - Q_[m].dot(Gradient(0))) * inverse_squared_[m];
    return true;
  }

  bool CompleteHull() {
    while (rank_ + 1 < active_.size) {
      if (!AppendColumn(CoordinatesOf(Gradient(rank_ + 1)))) return false;
    }
    return true;
  }

  // The weights of the point with coordinates y: of any sign, and with sum 1.
  void Barycentric(const double y[3], double weights[4]) const {
    weights[0] = 1;
    for (int m = rank_ - 1; m >= 0; --m) {
      double weight = y[m];
      for (int k = m + 1; k < rank_; ++k) weight -= U_[m][k] * weights[k + 1];
      weights[m + 1] = weight;
      weights[0] -= weight;
    }
  }

  // Moves the weights along `direction`, by the step `limit` or until the first
  // of them vanishes, and drops the pieces whose weights have vanished. Returns
  // the step. If it is unbounded, returns infinity and changes nothing.
  double MoveWeights(const double direction[4], double limit) {
    double step = limit;
    int blocking = -1;
    for (int k = 0; k < active_.size; ++k) {
      if (direction[k] < 0 && active_.weight[k] + step * direction[k] < 0) {
        step = -active_.weight[k] / direction[k];
        blocking = k;
      }
    }
    if (!std::isfinite(step)) return step;
    int kept = 0;
    for (int k = 0; k < active_.size; ++k) {
      const double weight = active_.weight[k] + step * direction[k];
      if (k == blocking || !(weight > 0)) {
        rank_ = std::min(rank_, std::max(kept - 1, 0));
        continue;
      }
      active_.index[kept] = active_.index[k];
      active_.weight[kept] = weight;
      ++kept;
    }
    active_.size = kept;
    return step;
  }

  void GiveUpLast() {
    --active_.size;
    double sum = 0;
    for (int k = 0; k < active_.size; ++k) sum += active_.weight[k];
    if (!(sum > 0)) active_.weight[0] = sum = 1;
    for (int k = 0; k < active_.size; ++k) active_.weight[k] /= sum;
  }

  const LinearPiece* pieces_;
  double smallest_squared_;
  SimplexQpSolution& active_;
  int rank_ = 0;  // columns of Q, those of pieces 1, ..., rank_
  Vector3d Q_[3];
  double inverse_squared_[3];  // 1 / |q|^2
  double U_[3][3];             // above the diagonal
  double z_[3];                // U'z = the differences of the values
  double minimizer_[3];        // in coordinates y
};

}  // namespace

void SolveSimplexQp(const LinearPiece* pieces, int count,
                    SimplexQpSolution* solution) {
  CheckAtLeast(1, count, "count");
  double scale = 0;
  double values = 0;
  int best = 0;
  double best_dual = std::numeric_limits<double>::infinity();
  for (int i = 0; i < count; ++i) {
    const double squared = pieces[i].gradient.squaredNorm();
    scale = std::max(scale, squared);
    values = std::max(values, std::abs(pieces[i].value));
    if (0.5 * squared - pieces[i].value < best_dual) {
      best_dual = 0.5 * squared - pieces[i].value;
      best = i;
    }
  }
  const double tolerance = 1e-15 * (values + scale);
  ActiveSet active(pieces, std::sqrt(scale), solution);
  if (solution->size == 0) {
    solution->size = 1;
    solution->index[0] = best;
    solution->weight[0] = 1;
  } else {
    active.Minimize();
  }
  active.SetStepAndLevel();
  // The limit ends cycles, which only rounding could cause: ordinary inputs
  // need about 2 changes per final piece.
  for (int change = 0; change < 200; ++change) {
    int highest = -1;
    double level = solution->level + tolerance;
    for (int i = 0; i < count; ++i) {
      const double value =
          pieces[i].value + pieces[i].gradient.dot(solution->step);
      if (value > level) {
        level = value;
        highest = i;
      }
    }
    if (highest < 0) return;
    for (int k = 0; k < solution->size; ++k) {
      if (solution->index[k] == highest) return;  // rounding
    }
    if (!active.Add(highest)) return;
    active.Minimize();
    active.SetStepAndLevel();
  }
}

Eigen::Vector3d MinNormPoint(const Eigen::Vector3d* vectors, int count,
                             std::vector<LinearPiece>* scratch) {
  scratch->clear();
  for (int i = 0; i < count; ++i) scratch->push_back({0, vectors[i]});
  SimplexQpSolution solution;
  SolveSimplexQp(scratch->data(), count, &solution);
  return -solution.step;
}

}  // namespace krot::internal

namespace krot {

using namespace internal;

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Up to rounding.
bool Holds(const Ball& ball, const Vector3d* points, int count) {
  for (int i = 0; i < count; ++i) {
    if (!((points[i] - ball.center).norm() <=
          ball.radius * (1 + 1e-12) + std::numeric_limits<double>::min())) {
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
