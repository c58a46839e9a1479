#include "krot/camera/remainder_bound.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

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
struct Enclosure {
  Interval f[2];
  Interval m[2];
  Interval remainder[2];  // f - m
  Interval determinant;   // det f'
};

Enclosure Enclose(const ErrorMap& map, const Box& box) {
  const double middle[2] = {Middle(box.q[0]), Middle(box.q[1])};
  const auto at_middle =
      map.Values({middle[0], middle[0]}, {middle[1], middle[1]});
  const auto on_box = map.Derivatives(box.q[0], box.q[1]);
  const Interval dx = box.q[0] - middle[0];
  const Interval dy = box.q[1] - middle[1];
  Enclosure enclosure;
  for (int i = 0; i < 2; ++i) {
    const Dual<Interval>& f = on_box.f[i];
    const Dual<Interval>& m = on_box.m[i];
    enclosure.f[i] = at_middle.f[i] + f.du * dx + f.dv * dy;
    enclosure.m[i] = at_middle.m[i] + m.du * dx + m.dv * dy;
    enclosure.remainder[i] = (at_middle.f[i] - at_middle.m[i]) +
                             (f.du - m.du) * dx + (f.dv - m.dv) * dy;
  }
  enclosure.determinant =
      on_box.f[0].du * on_box.f[1].dv - on_box.f[0].dv * on_box.f[1].du;
  return enclosure;
}

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
  const Interval* r = enclosure.remainder;
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

// The value of `value` at a point where f is near d / |d|, or minus infinity if
// none is found. A search ends when its bound is near the sampled value.
template <typename Value>
double Sample(const ErrorMap& map, double p, double d1, double d2,
              const Value& value) {
  const double norm = IntervalNorm({d1, d1}, {d2, d2}, p).hi;
  const double wanted[2] = {d1 / norm, d2 / norm};
  double q[2] = {wanted[0], wanted[1]};
  const auto values = [&] { return map.Values({q[0], q[0]}, {q[1], q[1]}); };
  for (int correction = 0; correction < 6; ++correction) {
    const auto at = values();
    for (int k = 0; k < 2; ++k) q[k] += wanted[k] - Middle(at.f[k]);
  }
  const auto at = values();
  const double f[2] = {Middle(at.f[0]), Middle(at.f[1])};
  const double size = IntervalNorm({f[0], f[0]}, {f[1], f[1]}, p).hi;
  return size < 1.5 && size > 0.5 ? value(at, size) : -kInfinity;
}

bool SegmentIsOutside(const ErrorMap& map, double p, const Box& segment,
                      int depth) {
  if (IsOutside(Enclose(map, segment), p)) return true;
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
    const Enclosure enclosure = Enclose(map, box);
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
        sampled, Sample(map, p, std::cos(angle), std::sin(angle),
                        [p](const auto& at, double size) {
                          return IntervalNorm(at.m[0], at.m[1], p).lo / size;
                        }));
  }
  const double target = sampled + std::max(0.1 * (sampled - 1), 1e-6);
  return Search(map, p, reach, target, bound_on);
}

std::optional<double> LargestAlong(const ErrorMap& map, double p, double reach,
                                   const Eigen::Vector2d& y,
                                   double sufficient) {
  const auto along = [&y](const Interval* v) {
    return v[0] * -y[0] + v[1] * -y[1];
  };
  // The point at which a line with normal -y touches the ball |f| <= 1.
  double d[2] = {-y[0], -y[1]};
  if (p == 1) d[std::abs(y[0]) < std::abs(y[1]) ? 0 : 1] = 0;
  if (std::isinf(p)) {
    for (double& x : d) x = x < 0 ? -1 : 1;
  }
  const double sampled =
      Sample(map, p, d[0], d[1], [&](const auto& at, double size) {
        return along(at.m).lo / std::max(size, 1.0);
      });
  // -y'm = -y'f + y'r. The first term is at most |f| <= 1, and the second is of
  // second order around x_hat.
  return Search(map, p, reach, std::max(sampled + 1e-7, sufficient),
                [&](const Enclosure& enclosure) {
                  const double direct = along(enclosure.m).hi;
                  const double first = along(enclosure.f).hi;
                  const Interval sum = Interval{0, first < 1 ? first : 1.0} -
                                       along(enclosure.remainder);
                  if (!(sum.hi < kInfinity)) return direct;
                  return direct < sum.hi ? direct : sum.hi;
                });
}

}  // namespace krot::internal
