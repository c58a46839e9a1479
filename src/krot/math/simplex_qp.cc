#include "krot/math/simplex_qp.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/base/check.h"

namespace krot {
namespace {

// Pieces whose gradients are closer than this to the affine hull of others,
// relative to the largest gradient, count as affinely dependent on them.
constexpr double kDependence = 1e-10;
// Pieces above the level by less than this, relative, do not violate it.
constexpr double kRounding = 1e-15;
// Far beyond what well-posed inputs need (about 2 changes per final piece);
// rounding alone could make the method cycle.
constexpr int kMaxChanges = 200;

// The affine hull of the active gradients as g_0 + range(D), D = Q R by
// Gram-Schmidt, at most three columns.
class ActiveHull {
 public:
  ActiveHull(const LinearPiece* pieces, const SimplexQpSolution& active,
             double scale)
      : pieces_(pieces), active_(active) {
    const Eigen::Vector3d& g0 = pieces[active.index[0]].gradient;
    for (int k = 1; k < active.size; ++k) {
      Eigen::Vector3d q = pieces[active.index[k]].gradient - g0;
      for (int m = 0; m < rank_; ++m) {
        R_[m][rank_] = Q_[m].dot(q);
        q -= R_[m][rank_] * Q_[m];
      }
      const double norm = q.norm();
      if (!(norm > kDependence * scale)) {
        independent_ = false;
        return;
      }
      R_[rank_][rank_] = norm;
      Q_[rank_] = q / norm;
      ++rank_;
    }
  }

  // Whether the active gradients are affinely independent.
  bool independent() const { return independent_; }

  // Barycentric coordinates in the hull of its point nearest to g; returns
  // the distance to it.
  double Project(const Eigen::Vector3d& g, double barycentric[4]) const {
    Eigen::Vector3d rest = g - pieces_[active_.index[0]].gradient;
    double y[3] = {};
    for (int m = 0; m < rank_; ++m) {
      y[m] = Q_[m].dot(rest);
      rest -= y[m] * Q_[m];
    }
    BackSubstitute(y, barycentric);
    return rest.norm();
  }

  // The weights (of any sign, sum 1) that solve the QP on the hull:
  // D'D nu = delta - D'g_0, delta the differences of the values.
  void Minimize(double weights[4]) const {
    const LinearPiece& first = pieces_[active_.index[0]];
    double y[3] = {};
    for (int m = 0; m < rank_; ++m) {  // R'y = delta, then R nu = y - Q'g_0
      y[m] = pieces_[active_.index[m + 1]].value - first.value;
      for (int k = 0; k < m; ++k) y[m] -= R_[k][m] * y[k];
      y[m] /= R_[m][m];
    }
    for (int m = 0; m < rank_; ++m) y[m] -= Q_[m].dot(first.gradient);
    BackSubstitute(y, weights);
  }

 private:
  void BackSubstitute(const double y[3], double weights[4]) const {
    double sum = 0;
    for (int m = rank_ - 1; m >= 0; --m) {
      double value = y[m];
      for (int k = m + 1; k < rank_; ++k) value -= R_[m][k] * weights[k + 1];
      weights[m + 1] = value / R_[m][m];
      sum += weights[m + 1];
    }
    weights[0] = 1 - sum;
  }

  const LinearPiece* pieces_;
  const SimplexQpSolution& active_;
  bool independent_ = true;
  int rank_ = 0;
  Eigen::Vector3d Q_[3];
  double R_[3][3] = {};
};

// Moves the weights along `direction`, at most by the step `limit`, until
// the first of them vanishes, and drops every piece whose weight has. Returns
// the step; infinite, with nothing moved, if nothing bounds it.
double MoveWeights(const double direction[], double limit,
                   SimplexQpSolution* active) {
  double step = limit;
  int blocking = -1;
  for (int k = 0; k < active->size; ++k) {
    if (direction[k] < 0 && -active->weight[k] / direction[k] < step) {
      step = -active->weight[k] / direction[k];
      blocking = k;
    }
  }
  if (!std::isfinite(step)) return step;
  int kept = 0;
  for (int k = 0; k < active->size; ++k) {
    const double weight = active->weight[k] + step * direction[k];
    if (k == blocking || !(weight > 0)) continue;
    active->index[kept] = active->index[k];
    active->weight[kept] = weight;
    ++kept;
  }
  active->size = kept;
  return step;
}

// As ActiveHull::Minimize for two pieces; `false` if they are dependent.
bool MinimizeOverTwo(const LinearPiece& first, const LinearPiece& second,
                     double scale, double weights[4]) {
  const Eigen::Vector3d difference = second.gradient - first.gradient;
  const double squared = difference.squaredNorm();
  const double smallest = kDependence * scale;
  if (!(squared > smallest * smallest)) return false;
  weights[1] =
      (second.value - first.value - difference.dot(first.gradient)) / squared;
  weights[0] = 1 - weights[1];
  return true;
}

// The weights that solve the QP on the affine hull of the active gradients,
// two or more; `false` if those are dependent.
bool MinimizeOverHull(const LinearPiece* pieces,
                      const SimplexQpSolution& active, double scale,
                      double weights[4]) {
  if (active.size == 2) {
    return MinimizeOverTwo(pieces[active.index[0]], pieces[active.index[1]],
                           scale, weights);
  }
  const ActiveHull hull(pieces, active, scale);
  if (hull.independent()) hull.Minimize(weights);
  return hull.independent();
}

// Brings the weights to the minimiser on the convex hull of a subset of the
// active pieces.
void MinimizeOverActive(const LinearPiece* pieces, double scale,
                        SimplexQpSolution* active) {
  while (active->size > 1) {
    double direction[4] = {};
    if (!MinimizeOverHull(pieces, *active, scale, direction)) {
      // By rounding only: give up the last piece.
      --active->size;
      double sum = 0;
      for (int k = 0; k < active->size; ++k) sum += active->weight[k];
      if (!(sum > 0)) active->weight[0] = sum = 1;
      for (int k = 0; k < active->size; ++k) active->weight[k] /= sum;
      continue;
    }
    for (int k = 0; k < active->size; ++k) direction[k] -= active->weight[k];
    const int size = active->size;
    MoveWeights(direction, /*limit=*/1, active);
    if (active->size == size) return;
  }
  active->weight[0] = 1;
}

// Adds piece j to the active ones. If its gradient depends on theirs, it
// takes the place of the one that blocks the move in its favour; `false` if
// the move is not blocked (by rounding only).
bool AddToActive(const LinearPiece* pieces, int j, double scale,
                 SimplexQpSolution* active) {
  const ActiveHull hull(pieces, *active, scale);
  double barycentric[4] = {};
  const double distance = hull.Project(pieces[j].gradient, barycentric);
  if (active->size < 4 && distance > kDependence * scale) {
    active->index[active->size] = j;
    active->weight[active->size] = 0;
    ++active->size;
    return true;
  }
  double direction[4] = {};
  for (int k = 0; k < active->size; ++k) direction[k] = -barycentric[k];
  const double step =
      MoveWeights(direction, std::numeric_limits<double>::infinity(), active);
  if (!std::isfinite(step) || active->size == 4) return false;
  active->index[active->size] = j;
  active->weight[active->size] = step;
  ++active->size;
  return true;
}

void SetStepAndLevel(const LinearPiece* pieces, SimplexQpSolution* solution) {
  solution->step.setZero();
  for (int k = 0; k < solution->size; ++k) {
    solution->step -= solution->weight[k] * pieces[solution->index[k]].gradient;
  }
  solution->level = 0;  // the mean: all agree at the minimiser
  for (int k = 0; k < solution->size; ++k) {
    const LinearPiece& piece = pieces[solution->index[k]];
    solution->level += solution->weight[k] *
                       (piece.value + piece.gradient.dot(solution->step));
  }
}

}  // namespace

void SolveSimplexQp(const LinearPiece* pieces, int count,
                    SimplexQpSolution* solution) {
  CheckArgument(count >= 1, "count", count, ">= 1");
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
  const double tolerance = kRounding * (values + scale);
  scale = std::sqrt(scale);

  if (solution->size == 0) {
    solution->size = 1;
    solution->index[0] = best;
    solution->weight[0] = 1;
  } else {
    MinimizeOverActive(pieces, scale, solution);
  }
  SetStepAndLevel(pieces, solution);
  for (int change = 0; change < kMaxChanges; ++change) {
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
    if (!AddToActive(pieces, highest, scale, solution)) return;
    MinimizeOverActive(pieces, scale, solution);
    SetStepAndLevel(pieces, solution);
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

}  // namespace krot
