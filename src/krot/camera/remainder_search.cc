#include "krot/camera/remainder_bound.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <Eigen/LU>

#include "krot/geometry.h"

namespace krot::internal {
namespace {

struct Box {
  Interval q[2];
};

double Middle(const Interval& a) { return 0.5 * a.lo + 0.5 * a.hi; }

// The set of |x| for x in a; NaN if a is.
Interval Absolute(const Interval& a) {
  if (!(a.lo <= a.hi)) return {kNaN, kNaN};
  if (a.lo >= 0) return a;
  if (a.hi <= 0) return -a;
  return {0, std::max(-a.lo, a.hi)};
}

// The part of a within [-1, 1]; a must meet that.
Interval ClipToUnit(const Interval& a) {
  return {std::max(a.lo, -1.0), std::min(a.hi, 1.0)};
}

Interval IntervalNorm(const Interval& x, const Interval& y, double p) {
  const Interval a = Absolute(x);
  const Interval b = Absolute(y);
  if (p == 1) return a + b;
  if (p == 2) {
    const Interval square = a * a + b * b;
    return sqrt(Interval{std::max(square.lo, 0.0), square.hi});
  }
  if (!(a.hi + b.hi >= 0)) return {kNaN, kNaN};
  return {std::max(a.lo, b.lo), std::max(a.hi, b.hi)};
}

// Enclosures of f and m on a box, by the mean value theorem from its middle.
class Enclosure {
 public:
  Enclosure(const ErrorMap& map, const Box& box) {
    const double middle[2] = {Middle(box.q[0]), Middle(box.q[1])};
    at_middle_ = map.Values({middle[0], middle[0]}, {middle[1], middle[1]});
    on_box_ = map.Derivatives(box.q[0], box.q[1]);
    for (int i = 0; i < 2; ++i) from_middle_[i] = box.q[i] - middle[i];
    for (int i = 0; i < 2; ++i) {
      f[i] = MeanValue(at_middle_.f[i], on_box_.f[i].du, on_box_.f[i].dv);
      m[i] = MeanValue(at_middle_.m[i], on_box_.m[i].du, on_box_.m[i].dv);
    }
    determinant =
        on_box_.f[0].du * on_box_.f[1].dv - on_box_.f[0].dv * on_box_.f[1].du;
  }

  // Encloses a'm - b'f, better than a'm and b'f by themselves where the two are
  // alike.
  Interval Difference(const Eigen::Vector2d& a,
                      const Eigen::Vector2d& b) const {
    const auto difference = [&](const auto& of) {
      return (of(on_box_.m[0]) * a[0] - of(on_box_.f[0]) * b[0]) +
             (of(on_box_.m[1]) * a[1] - of(on_box_.f[1]) * b[1]);
    };
    return MeanValue((at_middle_.m[0] * a[0] - at_middle_.f[0] * b[0]) +
                         (at_middle_.m[1] * a[1] - at_middle_.f[1] * b[1]),
                     difference([](const Dual<Interval>& x) { return x.du; }),
                     difference([](const Dual<Interval>& x) { return x.dv; }));
  }

  Interval f[2];
  Interval m[2];
  Interval determinant;  // det f'

 private:
  Interval MeanValue(const Interval& at_middle, const Interval& du,
                     const Interval& dv) const {
    return at_middle + du * from_middle_[0] + dv * from_middle_[1];
  }

  ErrorPair<Interval> at_middle_;
  ErrorPair<Dual<Interval>> on_box_;
  Interval from_middle_[2];
};

bool IsOutside(const Enclosure& enclosure, double p) {
  return IntervalNorm(enclosure.f[0], enclosure.f[1], p).lo > 1;
}

// Whether the box is beyond a fold, and |f| <= 1 on all of it.
bool IsFoldedInside(const Enclosure& enclosure, double p) {
  return enclosure.determinant.hi <= 0 &&
         IntervalNorm(enclosure.f[0], enclosure.f[1], p).hi <= 1;
}

// An upper bound on |m| where |f| <= 1, from m = f - r:
//   p = 2:         |m|^2 = |f|^2 - r'(f + m) <= 1 - r'(2 f - r)
//   p = 1, inf:    s'm = s'f - s'r <= 1 - s'r for all s with |s|_* = 1,
// where s'f is bounded by its own enclosure if that is below 1. NaN if there is
// no bound.
double BoundLinearError(const Enclosure& enclosure, double p) {
  const Interval r[2] = {
      -enclosure.Difference(Eigen::Vector2d::UnitX(), Eigen::Vector2d::UnitX()),
      -enclosure.Difference(Eigen::Vector2d::UnitY(),
                            Eigen::Vector2d::UnitY())};
  const double direct = IntervalNorm(enclosure.m[0], enclosure.m[1], p).hi;
  const Interval f[2] = {ClipToUnit(enclosure.f[0]),
                         ClipToUnit(enclosure.f[1])};
  double bound = 0;
  if (p == 2) {
    const Interval square =
        1.0 - (r[0] * (f[0] * 2.0 - r[0]) + r[1] * (f[1] * 2.0 - r[1]));
    bound = sqrt(Interval{0, std::max(square.hi, 0.0)}).hi;
    if (!(square.hi < kInfinity)) return kNaN;
  } else if (p == 1) {
    for (const double s : {-1.0, 1.0}) {
      for (const double t : {-1.0, 1.0}) {
        const Interval sf = f[0] * s + f[1] * t;
        const Interval sr = r[0] * s + r[1] * t;
        const Interval sm = Interval{0, std::min(sf.hi, 1.0)} - sr;
        if (!(sm.hi < kInfinity)) return kNaN;
        bound = std::max(bound, sm.hi);
      }
    }
  } else {
    for (int i = 0; i < 2; ++i) {
      for (const double s : {-1.0, 1.0}) {
        const Interval sm = Interval{0, (f[i] * s).hi} - r[i] * s;
        if (!(sm.hi < kInfinity)) return kNaN;
        bound = std::max(bound, sm.hi);
      }
    }
  }
  return direct < bound ? direct : bound;
}

// A box in which some points may have |f| <= 1, and the bound that is searched
// for them; infinite as long as det f' > 0 is not proved.
struct Cell {
  Box box;
  double bound;
};

bool ComesLater(const Cell& a, const Cell& b) { return a.bound < b.bound; }

// The two halves of a box, across its longer side.
std::pair<Box, Box> Halves(const Box& box) {
  const auto length = [&](int i) { return box.q[i].hi - box.q[i].lo; };
  const int longer = length(1) > length(0) ? 1 : 0;
  std::pair<Box, Box> halves = {box, box};
  halves.first.q[longer].hi = halves.second.q[longer].lo =
      Middle(box.q[longer]);
  return halves;
}

// |m| / |f| at a point where f is near d / |d|, or minus infinity if none is
// found.
double SampleLinearError(const ErrorMap& map, double p, double d1, double d2) {
  const double norm = IntervalNorm({d1, d1}, {d2, d2}, p).hi;
  const double wanted[2] = {d1 / norm, d2 / norm};
  double q[2] = {wanted[0], wanted[1]};
  const auto values = [&] { return map.Values({q[0], q[0]}, {q[1], q[1]}); };
  for (int correction = 0; correction < 6; ++correction) {
    const auto at = values();
    for (int k = 0; k < 2; ++k) q[k] += wanted[k] - Middle(at.f[k]);
  }
  const auto at = values();
  const double size = IntervalNorm(at.f[0], at.f[1], p).hi;
  return size < 1.5 && size > 0.5 ? IntervalNorm(at.m[0], at.m[1], p).lo / size
                                  : -kInfinity;
}

bool SegmentIsOutside(const ErrorMap& map, double p, const Box& segment,
                      int depth) {
  if (IsOutside(Enclosure(map, segment), p)) return true;
  if (depth == 8) return false;
  const auto [first, second] = Halves(segment);
  return SegmentIsOutside(map, p, first, depth + 1) &&
         SegmentIsOutside(map, p, second, depth + 1);
}

// Branch and bound: an upper bound over all points of the box |q|_inf <= reach
// with |f| <= 1. `bound_on` returns an upper bound on a smaller box. Ends when
// the bound is at most `target`, at a fold, or with the budget of 4000 cells.
template <typename BoundOn>
std::optional<double> Search(const ErrorMap& map, double p, double reach,
                             double target, const BoundOn& bound_on) {
  std::vector<Cell> heap;
  int num_cells = 0;
  bool is_folded = false;
  const auto add = [&](const Box& box) {
    ++num_cells;
    const Enclosure enclosure(map, box);
    if (IsOutside(enclosure, p)) return;
    is_folded |= IsFoldedInside(enclosure, p);
    const double bound =
        enclosure.determinant.lo > 0 ? bound_on(enclosure) : kNaN;
    heap.push_back({box, bound < kInfinity ? bound : kInfinity});
    std::push_heap(heap.begin(), heap.end(), ComesLater);
  };

  const Interval side = {-reach, reach};
  add({{side, side}});
  while (!heap.empty() && heap.front().bound > target && num_cells < 4000 &&
         !is_folded) {
    const auto [first, second] = Halves(heap.front().box);
    std::pop_heap(heap.begin(), heap.end(), ComesLater);
    heap.pop_back();
    add(first);
    add(second);
  }
  // The box with the pixel's own ray is never outside, so the heap should not
  // become empty.
  if (is_folded || heap.empty() || heap.front().bound == kInfinity) {
    return std::nullopt;
  }
  return heap.front().bound;
}

}  // namespace

bool BoundaryIsOutside(const ErrorMap& map, double p, double reach) {
  const Interval side = {-reach, reach};
  for (const double end : {-reach, reach}) {
    const Interval at_end = {end, end};
    if (!SegmentIsOutside(map, p, {{side, at_end}}, 0) ||
        !SegmentIsOutside(map, p, {{at_end, side}}, 0)) {
      return false;
    }
  }
  return true;
}

std::optional<double> LargestLinearError(const ErrorMap& map, double p,
                                         double reach, double sufficient) {
  const auto bound_on = [p](const Enclosure& enclosure) {
    return BoundLinearError(enclosure, p);
  };
  if (sufficient > 1) {
    const auto bound = Search(map, p, reach, sufficient, bound_on);
    if (!bound || *bound <= sufficient) return bound;
  }
  constexpr int kDirections = 16;
  double sampled = 1;
  for (int i = 0; i < kDirections; ++i) {
    const double angle = i * 2 * kPi / kDirections;
    sampled = std::max(
        sampled, SampleLinearError(map, p, std::cos(angle), std::sin(angle)));
  }
  const double target = sampled + std::max(0.1 * (sampled - 1), 1e-6);
  return Search(map, p, reach, target, bound_on);
}

namespace {

Interval Along(const Eigen::Vector2d& d, const Interval* v) {
  return v[0] * d[0] + v[1] * d[1];
}

// The point of the ball |f| <= 1 that is farthest along g.
Eigen::Vector2d FarthestInBall(const Eigen::Vector2d& g, double p) {
  if (p == 2) return g.normalized();
  const Eigen::Vector2d corner(g[0] < 0 ? -1 : 1, g[1] < 0 ? -1 : 1);
  if (std::isinf(p)) return corner;
  const int longer = std::abs(g[0]) < std::abs(g[1]) ? 1 : 0;
  return corner[longer] * Eigen::Vector2d::Unit(longer);
}

// Where -y'm is largest over |f| <= 1, as far as that is found. It only guides
// the search.
struct Touch {
  Eigen::Vector2d gradient;   // of -y'm there, as a function of f
  double value = -kInfinity;  // of -y'm; a search ends near it
};

// Newton's method, with a new direction in every step: f is to be the point of
// the ball that is farthest along the gradient.
Touch FindTouch(const ErrorMap& map, double p, double reach,
                const Eigen::Vector2d& y) {
  Touch touch{-y};
  Eigen::Vector2d q = FarthestInBall(-y, p);
  for (int step = 0; step < 12; ++step) {
    const auto at = map.Derivatives({q[0], q[0]}, {q[1], q[1]});
    Eigen::Vector2d f, m;
    Eigen::Matrix2d df, dm;  // by q
    for (int i = 0; i < 2; ++i) {
      f[i] = Middle(at.f[i].value);
      m[i] = Middle(at.m[i].value);
      df.row(i) << Middle(at.f[i].du), Middle(at.f[i].dv);
      dm.row(i) << Middle(at.m[i].du), Middle(at.m[i].dv);
    }
    const Eigen::Matrix2d df_inverse = df.inverse();
    const Eigen::Vector2d gradient = -(dm * df_inverse).transpose() * y;
    if (!gradient.allFinite()) break;
    touch.gradient = gradient;
    const double size = IntervalNorm({f[0], f[0]}, {f[1], f[1]}, p).hi;
    if (size < 1 + 1e-5) {
      touch.value = std::max(touch.value, -y.dot(m) / std::max(size, 1.0));
    }
    const Eigen::Vector2d missing = FarthestInBall(gradient, p) - f;
    q += df_inverse * missing;
    if (missing.norm() < 1e-8 || !(q.lpNorm<Eigen::Infinity>() <= reach)) break;
  }
  return touch;
}

}  // namespace

std::optional<double> LargestAlong(const ErrorMap& map, double p, double reach,
                                   const Eigen::Vector2d& y,
                                   double sufficient) {
  const Touch touch = FindTouch(map, p, reach, y);
  const Eigen::Vector2d& g = touch.gradient;
  const Eigen::Vector2d across(-g[1], g[0]);
  const double length = DualNorm(g, {p}) * (1 + 1e-14);
  // For any g, -y'm = g'f + (-y'm - g'f). With the gradient, the second term is
  // of second order around the touch. The first is at most |g|_*; for p = 2, as
  // (g'f)^2 + (across'f)^2 = |g|^2 |f|^2, it falls as fast on both sides of the
  // touch. So boxes may be the larger, the farther away they are.
  const auto bound_on = [&](const Enclosure& enclosure) {
    double first = Along(g, enclosure.f).hi;
    if (!(first < length)) first = length;
    const Interval aside = Absolute(Along(across, enclosure.f));
    if (p == 2 && aside.lo < length) {
      const Interval square = Interval{length, length} * length -
                              Interval{aside.lo, aside.lo} * aside.lo;
      first = std::min(first, sqrt(square).hi);
    }
    const double sum = (first + enclosure.Difference(-y, g)).hi;
    const double direct = Along(-y, enclosure.m).hi;
    return direct < sum ? direct : sum;
  };
  return Search(map, p, reach, std::max(touch.value + 1e-7, sufficient),
                bound_on);
}

}  // namespace krot::internal
