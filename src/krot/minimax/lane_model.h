#pragma once

#include <limits>

#include "krot/minimax/kernels.h"
#include "krot/minimax/lane_hull.h"
#include "krot/minimax/lanes.h"

namespace krot::internal::KROT_UNITS {

// The local model of newton_descent.h in all lanes, for p = 2, with all
// residuals as members. Each function passes over the rows once. For kernels
// only.

// One residual of every lane: v = A x + b, w = c'x + d.
struct LaneResidual {
  Lanes3 a1, a2, c;
  Lanes b1, b2, d;

  explicit LaneResidual(const LaneRow& row)
      : a1(Three(row, 0)),
        a2(Three(row, 4)),
        c(Three(row, 8)),
        b1(Load(row.entry[3])),
        b2(Load(row.entry[7])),
        d(Load(row.entry[11])) {}

  static Lanes3 Three(const LaneRow& row, int first) {
    return {Load(row.entry[first]), Load(row.entry[first + 1]),
            Load(row.entry[first + 2])};
  }

  Lanes V1(const Lanes3& x) const { return Dot(a1, x) + b1; }
  Lanes V2(const Lanes3& x) const { return Dot(a2, x) + b2; }
  Lanes Depth(const Lanes3& x) const { return Dot(c, x) + d; }
};

// The rows of all lanes, as many as the longest problem has.
struct LaneRows {
  const LaneRow* rows;
  int count;
};

// max_i r_i(x); infinity unless all depths are positive.
inline Lanes EvaluateLanes(const LaneRows& rows, const Lanes3& x) {
  Lanes largest = 0;
  for (int i = 0; i < rows.count; ++i) {
    const LaneResidual r(rows.rows[i]);
    const Lanes v1 = r.V1(x);
    const Lanes v2 = r.V2(x);
    const Lanes w = r.Depth(x);
    const Lanes squared = (v1 * v1 + v2 * v2) / (w * w);
    largest = Max(largest, Select(w > 0, squared,
                                  std::numeric_limits<double>::infinity()));
  }
  return Sqrt(largest);
}

// Writes the pieces at x, also to the hull's corners, and returns
// sum_i mu_i c_i b_i b_i'. mu_i is `multiplier[a]` if corner a is piece i,
// otherwise 0; in the lanes `raises` it is no less than before. *cost is the
// maximum at x.
inline LaneMatrix LinearizeLanes(const LaneRows& rows, const Lanes3& x,
                                 const Lanes multiplier[kCorners],
                                 const LaneMask& raises, LanePiece* pieces,
                                 LaneHull* hull, Lanes* cost) {
  LaneMatrix curvature = {0, 0, 0, 0, 0, 0};
  *cost = 0;
  for (LaneCorner& corner : hull->corner) {
    corner.value = corner.multiplier = 0;
    corner.gradient = {0, 0, 0};
  }
  for (int i = 0; i < rows.count; ++i) {
    const LaneResidual r(rows.rows[i]);
    LanePiece& piece = pieces[i];
    const Lanes v1 = r.V1(x);
    const Lanes v2 = r.V2(x);
    const Lanes w = r.Depth(x);
    const Lanes norm = Sqrt(v1 * v1 + v2 * v2);
    const Lanes n = Select(norm > 0, norm, 1);
    const Lanes inverse = 1 / (n * w);  // c_i
    const Lanes w_inverse = inverse * n;
    const Lanes s1 = v1 * (inverse * w);
    const Lanes s2 = v2 * (inverse * w);
    const Lanes value = norm * w_inverse;
    const Lanes3 gradient = w_inverse * (s1 * r.a1 + s2 * r.a2 - value * r.c);
    const Lanes3 bend = s1 * r.a2 - s2 * r.a1;  // b_i
    Lanes mu = Select(raises, Load(piece.multiplier), 0);
    for (int a = 0; a < kCorners; ++a) {
      mu = Max(mu, Select(hull->corner[a].index == i, multiplier[a], 0));
    }
    for (LaneCorner& corner : hull->corner) {
      const LaneMask is_it = corner.index == i;
      corner.value = Select(is_it, value, corner.value);
      corner.gradient = Select(is_it, gradient, corner.gradient);
      corner.multiplier = Select(is_it, mu, corner.multiplier);
    }
    curvature = curvature + (mu * inverse) * Square(bend);
    *cost = Max(*cost,
                Select(w > 0, value, std::numeric_limits<double>::infinity()));
    Store(mu, &piece.multiplier);
    Store(value, &piece.value);
    Store(gradient, &piece.gradient);
    Store(w_inverse, &piece.depth_inverse);
  }
  return curvature;
}

// G of the first `count` residuals, and the largest of their depths.
inline LaneMatrix MetricOfLanes(const LaneRows& rows, const Lanes3& x,
                                const Lanes& cost, const Lanes& count,
                                Lanes* depth) {
  LaneMatrix sum = {0, 0, 0, 0, 0, 0};
  *depth = 0;
  const Lanes squared = cost * cost;
  for (int i = 0; i < rows.count; ++i) {
    const LaneResidual r(rows.rows[i]);
    const Lanes w = r.Depth(x);
    *depth = Max(*depth, Select(Lanes(i) < count, w, 0));
    const Lanes share = 1 / (w * w);
    sum = sum + share * (Square(r.a1) + Square(r.a2) + squared * Square(r.c));
  }
  return (1 / (cost * count)) * sum;
}

// The largest relative fall of a depth by the step d.
inline Lanes FallOfLanes(const LaneRows& rows, const LanePiece* pieces,
                         const Lanes3& d) {
  Lanes fall = 0;
  for (int i = 0; i < rows.count; ++i) {
    const Lanes change = Dot(LaneResidual::Three(rows.rows[i], 8), d);
    fall = Max(fall, -change * Load(pieces[i].depth_inverse));
  }
  return fall;
}

// The piece with the largest value at d, if that is above `threshold`;
// otherwise its index is kNoPieceIndex.
inline LaneCorner HighestPiece(const LanePiece* pieces, int count,
                               const Lanes3& d, const Lanes& threshold) {
  LaneCorner piece;
  piece.index = Select(threshold < 0, kZeroPieceIndex, kNoPieceIndex);
  piece.weight = piece.value = piece.multiplier = 0;
  piece.gradient = {0, 0, 0};
  Lanes highest = Max(threshold, 0);
  for (int i = 0; i < count; ++i) {
    const Lanes value = Load(pieces[i].value);
    const Lanes3 gradient = Load(pieces[i].gradient);
    const Lanes there = value + Dot(gradient, d);
    const LaneMask is_higher = there > highest;
    highest = Select(is_higher, there, highest);
    piece.index = Select(is_higher, i, piece.index);
    piece.value = Select(is_higher, value, piece.value);
    piece.gradient = Select(is_higher, gradient, piece.gradient);
    piece.multiplier =
        Select(is_higher, Load(pieces[i].multiplier), piece.multiplier);
  }
  return piece;
}

// The minimiser of the model.
struct LaneStep {
  Lanes3 d;
  Lanes level;
  Lanes held_back;   // d'Hd
  LaneMask is_open;  // lanes in which it is not found yet
};

// Minimises the model with H^-1 = L'L in the lanes `running`, starting from the
// hull's active set. Scales the gradients of the hull by L. At most four moves
// of weights are made in one call; lanes that need more continue in the next
// one. With fewer moves, steps take more calls; with more, other lanes wait
// longer.
inline LaneStep MinimizeLaneModel(const LanePiece* pieces, int count,
                                  const LaneMatrix& L, const Lanes& cost,
                                  const LaneMask& running, LaneHull* hull) {
  for (LaneCorner& corner : hull->corner) {
    corner.gradient = Times(L, corner.gradient);
  }
  LaneStep result = {{0, 0, 0}, 0, 0, running};
  LaneMask& is_open = result.is_open;
  for (int move = 0; move < 4 && Any(is_open); ++move) {
    const LaneMask is_due = hull->MoveWeights();
    const Lanes3 step = hull->Step();
    const Lanes level = hull->Level(step);
    const Lanes3 d = TransposedTimes(L, step);
    result.d = Select(is_open, d, result.d);
    result.level = Select(is_open, level, result.level);
    result.held_back = Select(is_open, Dot(step, step), result.held_back);
    const Lanes rounding = 1e-15 * Max(cost, hull->Scale());  // simplex_qp.cc
    LaneCorner piece = HighestPiece(pieces, count, d, level + rounding);
    const LaneMask is_higher =
        (piece.index > kNoPieceIndex) & ~hull->Holds(piece.index);
    const LaneMask adding = is_open & ~is_due & is_higher;
    is_open = is_open & is_due;
    if (!Any(adding)) continue;
    piece.gradient = Times(L, piece.gradient);
    is_open = is_open | hull->Add(adding, piece);
  }
  return result;
}

}  // namespace krot::internal::KROT_UNITS
