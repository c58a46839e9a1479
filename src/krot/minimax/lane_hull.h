#pragma once

#include <limits>

#include "krot/minimax/lanes.h"

namespace krot::internal::KROT_UNITS {

// The active-set method of simplex_qp.cc in all lanes at once: it makes the
// same moves of weights, one at a time, in every lane that needs one. For
// kernels only.

// An active piece, in the coordinates where the curvature is 1.
struct LaneCorner {
  Lanes index;
  Lanes weight;  // > 0, sum 1; 0 where there is no piece
  Lanes value;
  Lanes multiplier;  // of its residual in H
  Lanes3 gradient;
};

inline LaneCorner Select(const LaneMask& mask, const LaneCorner& yes,
                         const LaneCorner& no) {
  return {Select(mask, yes.index, no.index),
          Select(mask, yes.weight, no.weight),
          Select(mask, yes.value, no.value),
          Select(mask, yes.multiplier, no.multiplier),
          Select(mask, yes.gradient, no.gradient)};
}

struct LaneHull {
  Lanes size;
  LaneCorner corner[kCorners];  // the first `size` of them

  // Moves the weights towards the minimiser on the affine hull. If a weight
  // vanishes before that is reached, drops its corner. Returns the lanes where
  // it did, which need another move.
  LaneMask MoveWeights();

  // The minimiser -sum weight gradient, in lanes that need no move, and the
  // level of the pieces there; minus infinity if there are none.
  Lanes3 Step() const;
  Lanes Level(const Lanes3& step) const;

  // Adds `piece` in the lanes `adding`, which must need no move: as another
  // corner or, if its gradient depends on theirs, in place of the corner whose
  // weight vanishes first as the weight of `piece` grows. Returns where it did;
  // it fails only by rounding.
  LaneMask Add(const LaneMask& adding, const LaneCorner& piece);

  // The largest |gradient|^2 of the corners.
  Lanes Scale() const;

  // The lanes in which corner a exists.
  LaneMask Has(int a) const { return Lanes(a) < size; }
  // The lanes in which a corner has this index.
  LaneMask Holds(const Lanes& index) const;

 private:
  void Orthogonalise();
  void Minimizer(Lanes weights[kCorners]) const;
  void Barycentric(const Lanes y[3], Lanes weights[kCorners]) const;
  void Drop(const Lanes& dropped);

  // gradient_k - gradient_0 = Q U with orthogonal columns q. For a column that
  // depends on others, up to rounding, inverse_squared_ is 0 for 1 / |q|^2.
  Lanes3 q_[3];
  Lanes inverse_squared_[3];
  Lanes u01_, u02_, u12_;
};

namespace detail {

// See simplex_qp.cc.
inline constexpr double kLaneDependence = 1e-10;

// The smallest of `step` and of the ratios that count, and its corner.
struct FirstBlocking {
  Lanes step;
  Lanes corner = kNoPieceIndex;

  void Meet(int a, const LaneMask& counts, const Lanes& ratio) {
    const LaneMask is_first = counts & (ratio < step);
    step = Select(is_first, ratio, step);
    corner = Select(is_first, a, corner);
  }
};

}  // namespace detail

inline Lanes LaneHull::Scale() const {
  Lanes scale = 0;
  for (int a = 0; a < kCorners; ++a) {
    const Lanes3& g = corner[a].gradient;
    scale = Max(scale, Select(Has(a), Dot(g, g), 0));
  }
  return scale;
}

inline LaneMask LaneHull::Holds(const Lanes& index) const {
  LaneMask holds = corner[0].index == index;
  for (int a = 1; a < kCorners; ++a) holds = holds | (corner[a].index == index);
  return holds;
}

inline void LaneHull::Orthogonalise() {
  const double dependence = detail::kLaneDependence;
  const Lanes smallest = dependence * dependence * Scale();
  const auto column = [this](int a) {
    return Select(Has(a), corner[a].gradient - corner[0].gradient, {0, 0, 0});
  };
  const auto invert = [&smallest](const Lanes3& q) {
    const Lanes squared = Dot(q, q);
    return Select(squared > smallest, 1 / squared, 0);
  };
  q_[0] = column(1);
  inverse_squared_[0] = invert(q_[0]);
  u01_ = Dot(q_[0], column(2)) * inverse_squared_[0];
  u02_ = Dot(q_[0], column(3)) * inverse_squared_[0];
  q_[1] = column(2) - u01_ * q_[0];
  inverse_squared_[1] = invert(q_[1]);
  const Lanes3 rest = column(3) - u02_ * q_[0];
  u12_ = Dot(q_[1], rest) * inverse_squared_[1];
  q_[2] = rest - u12_ * q_[1];
  inverse_squared_[2] = invert(q_[2]);
}

// The weights, of any sign and sum 1, of the point with coordinates y.
inline void LaneHull::Barycentric(const Lanes y[3],
                                  Lanes weights[kCorners]) const {
  weights[3] = y[2];
  weights[2] = y[1] - u12_ * weights[3];
  weights[1] = y[0] - u01_ * weights[2] - u02_ * weights[3];
  weights[0] = 1 - weights[1] - weights[2] - weights[3];
}

// The weights, of any sign, of the minimiser on the affine hull.
inline void LaneHull::Minimizer(Lanes weights[kCorners]) const {
  const Lanes z0 = corner[1].value - corner[0].value;
  const Lanes z1 = corner[2].value - corner[0].value - u01_ * z0;
  const Lanes z2 = corner[3].value - corner[0].value - u02_ * z0 - u12_ * z1;
  const Lanes3& g = corner[0].gradient;
  const Lanes y[3] = {(z0 - Dot(q_[0], g)) * inverse_squared_[0],
                      (z1 - Dot(q_[1], g)) * inverse_squared_[1],
                      (z2 - Dot(q_[2], g)) * inverse_squared_[2]};
  Barycentric(y, weights);
}

inline LaneMask LaneHull::MoveWeights() {
  Orthogonalise();
  Lanes target[kCorners];
  Minimizer(target);
  detail::FirstBlocking blocking{1};
  for (int a = 0; a < kCorners; ++a) {
    const Lanes direction = target[a] - corner[a].weight;
    blocking.Meet(a, Has(a) & (direction < 0), -corner[a].weight / direction);
  }
  Lanes dropped = kNoPieceIndex;
  for (int a = 0; a < kCorners; ++a) {
    const Lanes& before = corner[a].weight;
    Lanes weight = before + blocking.step * (target[a] - before);
    weight = Select(blocking.step == 1, target[a], weight);
    weight = Select(blocking.corner == a, 0, weight);
    dropped = Select(Has(a) & ~(weight > 0), a, dropped);
    corner[a].weight = Select(Has(a), Max(weight, 0), 0);
  }
  const LaneMask drops = dropped >= 0;
  if (Any(drops)) Drop(dropped);
  return drops;
}

// Replaces the corner number `dropped`, in lanes where it is >= 0, by the last
// corner.
inline void LaneHull::Drop(const Lanes& dropped) {
  LaneCorner last = corner[0];
  for (int a = 1; a < kCorners; ++a) last = Select(Has(a), corner[a], last);
  size = Select(dropped >= 0, size - 1, size);
  for (int a = 0; a < kCorners; ++a) {
    corner[a] = Select(dropped == a, last, corner[a]);
    corner[a].weight = Select(Has(a), corner[a].weight, 0);
    corner[a].index = Select(Has(a), corner[a].index, kNoPieceIndex);
  }
}

inline Lanes3 LaneHull::Step() const {
  Lanes3 step = {0, 0, 0};
  for (const LaneCorner& c : corner) step = step - c.weight * c.gradient;
  return step;
}

// Computed as the weighted mean, as all pieces have the same value at the
// minimiser.
inline Lanes LaneHull::Level(const Lanes3& step) const {
  Lanes level = 0;
  for (const LaneCorner& c : corner) {
    level += c.weight * (c.value + Dot(c.gradient, step));
  }
  return Select(size > 0, level, -std::numeric_limits<double>::infinity());
}

inline LaneMask LaneHull::Add(const LaneMask& adding, const LaneCorner& piece) {
  const LaneMask begins = adding & (size == 0);
  Lanes3 rest = piece.gradient - corner[0].gradient;
  Lanes y[3];
  for (int m = 0; m < 3; ++m) {
    y[m] = Dot(q_[m], rest) * inverse_squared_[m];
    rest = rest - y[m] * q_[m];
  }
  const double dependence = detail::kLaneDependence;
  const Lanes scale = Max(Scale(), Dot(piece.gradient, piece.gradient));
  const LaneMask is_independent =
      Dot(rest, rest) > dependence * dependence * scale;
  const LaneMask appends =
      begins | (adding & (size < kCorners) & is_independent);
  Lanes toward[kCorners];
  Barycentric(y, toward);
  detail::FirstBlocking blocking{std::numeric_limits<double>::infinity()};
  for (int a = 0; a < kCorners; ++a) {
    blocking.Meet(a, Has(a) & (toward[a] > 0), corner[a].weight / toward[a]);
  }
  const LaneMask replaces = adding & ~appends & (blocking.corner >= 0);
  LaneCorner added = piece;
  added.weight = Select(begins, 1, Select(replaces, blocking.step, 0));
  for (int a = 0; a < kCorners; ++a) {
    Lanes& weight = corner[a].weight;
    weight = Select(replaces & Has(a),
                    Max(weight - blocking.step * toward[a], 0), weight);
    const LaneMask takes =
        (replaces & (blocking.corner == a)) | (appends & (size == a));
    corner[a] = Select(takes, added, corner[a]);
  }
  size = Select(appends, size + 1, size);
  return appends | replaces;
}

}  // namespace krot::internal::KROT_UNITS
