#include "krot/tolerance/tolerance_analysis.h"

#include <algorithm>
#include <functional>

#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/sweeps/res_int.h"

namespace krot::internal {
namespace {

// The same pulls in a part of the problem; none if it lacks one of them.
std::optional<Pulls> AllInPart(const ProblemSubset& part, const Pulls& pulls) {
  Pulls in_part;
  for (const Pull& pull : pulls) {
    const std::optional<Pull> placed = InPart(part, pull);
    if (!placed) return std::nullopt;
    in_part.push_back(*placed);
  }
  return in_part;
}

// Finds ends of sums over the same targets, whatever their directions.
class EndSearch {
 public:
  EndSearch(const ToleranceProblem& shared, const ProblemSubset& usable,
            const Pulls& targets, double tolerance, const Context& context)
      : shared_(shared),
        usable_(usable),
        tolerance_(tolerance),
        context_(context),
        reprojection_(shared.model(), shared.built()),
        set_(usable.problem()),
        usables_(shared.problem()) {
    for (int32_t k = 0; k < shared.problem().num_points; ++k) {
      if (usable.FindPoint(k)) usables_.AddPoint(k);
    }
    for (const Pull& target : targets) {
      if (!IsFixedPosition(shared.problem(), target)) moving_.push_back(target);
    }
    Pulls members = moving_;
    if (shared.scale()) members.push_back(*shared.scale());
    if (shared.gauge().first) members.push_back(*shared.gauge().first);
    for (const Pull& member : members) {
      if (member.kind != Pull::Kind::kPoint) continue;
      if (const auto point = usable.FindPoint(member.index)) {
        set_.AddPoint(*point);
      }
    }
    set_.AddTies(num_ties_);
  }

  // The largest sum over pulls at the targets. `on_reached` is told of every
  // estimate within the bound that was met.
  BoxEnd FindEnd(const Pulls& pulls,
                 const std::function<void(const Estimate&)>& on_reached = {}) {
    // What is fixed adds a constant.
    Pulls moving;
    double constant = 0;
    double size = 0;
    for (const Pull& pull : pulls) {
      const Eigen::Vector3d x =
          PositionOf(shared_.problem(), shared_.centre(), pull);
      size += pull.direction.cwiseAbs().dot(x.cwiseAbs());
      if (IsFixedPosition(shared_.problem(), pull)) {
        constant += pull.direction.dot(x);
      } else {
        moving.push_back(pull);
      }
    }
    const double at_centre = Along(shared_.problem(), shared_.centre(), moving);
    BoxEnd end;
    end.reached = at_centre;
    ExtentOptions options;
    options.norm = shared_.norm();
    options.bound = shared_.bound();
    options.tolerance = tolerance_ / 2;
    for (int round = 1; !context_.IsCancelled(); ++round) {
      const ProblemSubset part = ConnectedSet();
      std::optional<ScaleRow> scale;
      if (shared_.scale()) {
        scale = InPart(part, *InPart(usable_, *shared_.scale()));
      }
      const Extent extent = FindExtent(
          part.problem(), *AllInPart(part, *AllInPart(usable_, moving)), scale,
          options, context_, part.Restrict(usable_.Restrict(shared_.centre())));
      ++num_programmes_;
      if (extent.proved) {
        end.proved =
            std::min(*extent.proved, end.proved.value_or(*extent.proved));
      }
      Estimate of_usable;
      const Estimate far_end = Complete(part, extent.estimate, &of_usable);
      const Estimate allowed = ReachAllowed(far_end);
      if (on_reached) on_reached(allowed);
      end.reached =
          std::max(end.reached, Along(shared_.problem(), allowed, moving));
      if (end.proved &&
          *end.proved - end.reached <= tolerance_ * (*end.proved - at_centre)) {
        break;
      }
      if (set_.IsAll()) break;
      if (round == 12) {
        set_.AddAll();
      } else if (set_.AddAbove(of_usable, shared_.norm(),
                               (1 + kErrorRounding) * shared_.bound(),
                               2 * set_.num_points()) == 0) {
        break;
      }
    }
    end.reached += constant;
    if (end.proved && moving.size() < pulls.size()) {
      *end.proved += constant + kProofRounding * size;
    }
    return end;
  }

  int64_t num_programmes() const { return num_programmes_; }

 private:
  const KnownRotationProblem& problem() const { return usable_.problem(); }
  // The part of the working set that is connected to what is fixed. The set
  // grows until that part has the target and what keeps the scale.
  ProblemSubset ConnectedSet() {
    for (;;) {
      ProblemSubset part(problem(),
                         HeldObservations(problem(), set_.Observations()));
      const auto holds = [&](const Pull& pull) {
        return InPart(part, *InPart(usable_, pull)).has_value();
      };
      if (set_.IsAll() || (std::all_of(moving_.begin(), moving_.end(), holds) &&
                           (!shared_.scale() || holds(*shared_.scale())))) {
        return part;
      }
      num_ties_ *= 2;
      set_.AddTies(num_ties_);
      if (num_ties_ > problem().num_points) set_.AddAll();
    }
  }

  // Moves the frames outside of the usable part to where they fit in best.
  void PlaceOtherFrames(Estimate* estimate) const {
    const KnownRotationProblem& whole = shared_.problem();
    const auto is_theirs = [&](int64_t i) {
      const Observation& o = whole.observations[i];
      return usable_.FindPoint(o.point) && !usable_.FindView(o.view);
    };
    const ProblemSubset part(
        whole, IndicesWhere(SignedSize(whole.observations), is_theirs));
    Estimate placed = part.Restrict(*estimate);
    BlockSweep(part.problem(), FastDescentOptions(), shared_.norm(), context_)
        .ResectFrames(&placed);
    part.Replace(placed, estimate);
  }

  // Moves the points outside of the set to where they fit in best. Those of the
  // set stay, even if they are above the bound by a rounding error.
  void PlaceOthers(const KnownRotationProblem& whole, const WorkingSet& set,
                   Estimate* estimate) const {
    Estimate placed = *estimate;
    PlacePoints(whole, shared_.norm(), context_, shared_.bound(), &placed);
    for (int32_t k = 0; k < whole.num_points; ++k) {
      if (!set.Contains(k)) estimate->points[k] = placed.points[k];
    }
  }

  // The whole estimate: that of the set, and all other points where they fit
  // best.
  Estimate Complete(const ProblemSubset& part, const Estimate& estimate,
                    Estimate* of_usable) const {
    Estimate whole = shared_.centre();
    *of_usable = usable_.Restrict(whole);
    part.Replace(estimate, of_usable);
    PlaceOthers(problem(), set_, of_usable);
    usable_.Replace(*of_usable, &whole);
    PlaceOtherFrames(&whole);
    PlaceOthers(shared_.problem(), usables_, &whole);
    return whole;
  }

  // The farthest estimate on the segment from the centre whose true errors are
  // all within the bound.
  Estimate ReachAllowed(const Estimate& far_end) const {
    const auto is_allowed = [&](const Estimate& estimate) {
      return reprojection_.TrueCost(estimate, shared_.norm(),
                                    context_.num_threads) <= shared_.bound();
    };
    if (is_allowed(far_end)) return far_end;
    double allowed = 0;
    for (double step = 0.5; step >= 1.0 / 1024; step /= 2) {
      if (is_allowed(Between(shared_.centre(), far_end, allowed + step))) {
        allowed += step;
      }
    }
    return Between(shared_.centre(), far_end, allowed);
  }

  const ToleranceProblem& shared_;
  const ProblemSubset& usable_;
  Pulls moving_;  // targets
  const double tolerance_;
  const Context context_;
  const Reprojection reprojection_;
  WorkingSet set_;      // of the usable part
  WorkingSet usables_;  // all points of the usable part, in the whole
  int num_ties_ = 20;   // of every frame; doubled until it is connected
  int64_t num_programmes_ = 0;
};

BoxEnd Negative(BoxEnd end) {
  end.reached = -end.reached;
  if (end.proved) *end.proved = -*end.proved;
  return end;
}

}  // namespace

PositionBox FindBox(const ToleranceProblem& problem, const Pull& target,
                    double tolerance, const Context& context) {
  PositionBox box;
  const Eigen::Vector3d position =
      PositionOf(problem.problem(), problem.centre(), target);
  const bool is_fixed = IsFixedPosition(problem.problem(), target);
  for (int axis = 0; axis < 3; ++axis) {
    box.low[axis].reached = box.high[axis].reached = position[axis];
    if (!is_fixed) continue;
    box.low[axis].proved = box.high[axis].proved = position[axis];
  }
  if (is_fixed) return box;
  const std::optional<ProblemSubset> usable = problem.UsablePart({target});
  if (!usable) return box;
  EndSearch search(problem, *usable, {target}, tolerance, context);
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d along = Eigen::Vector3d::Unit(axis);
    box.low[axis] =
        Negative(search.FindEnd({{target.kind, target.index, -along}}));
    box.high[axis] = search.FindEnd({{target.kind, target.index, along}});
  }
  box.num_programmes = search.num_programmes();
  return box;
}

namespace {

using Pair = std::array<Pull, 2>;

Eigen::Vector3d DifferenceOf(const KnownRotationProblem& problem,
                             const Estimate& estimate, const Pair& pair) {
  return PositionOf(problem, estimate, pair[1]) -
         PositionOf(problem, estimate, pair[0]);
}

bool IsSame(const KnownRotationProblem& problem, const Pull& a, const Pull& b) {
  if (a.kind != b.kind) return false;
  return a.kind == Pull::Kind::kPoint
             ? a.index == b.index
             : problem.views[a.index].frame == problem.views[b.index].frame;
}

// Whether the difference is the same in all estimates.
bool IsConstant(const KnownRotationProblem& problem, const Pair& pair) {
  return IsSame(problem, pair[0], pair[1]) ||
         (IsFixedPosition(problem, pair[0]) &&
          IsFixedPosition(problem, pair[1]));
}

// Whether the gauge keeps the difference's length along its direction.
bool IsScale(const ToleranceProblem& problem, const Pair& pair) {
  const ToleranceGauge& gauge = problem.gauge();
  if (!problem.scale()) return false;
  const auto is = [&](const Pull& a, const Pull& b) {
    return a.kind == b.kind && a.index == b.index;
  };
  return (is(pair[0], *gauge.first) && is(pair[1], *gauge.second)) ||
         (is(pair[1], *gauge.first) && is(pair[0], *gauge.second));
}

}  // namespace

LengthRange FindLength(const ToleranceProblem& problem, const Pair& targets,
                       const std::optional<Pair>& unit, double tolerance,
                       const Context& context) {
  const KnownRotationProblem& whole = problem.problem();
  const auto length_of = [&](const Estimate& estimate, const Pair& pair) {
    return DifferenceOf(whole, estimate, pair).norm();
  };
  const double at_centre = length_of(problem.centre(), targets);
  LengthRange range;
  range.low.reached = range.high.reached = at_centre;
  if (IsConstant(whole, targets)) {
    const double size = PositionOf(whole, problem.centre(), targets[0]).norm();
    range.low.proved =
        std::max(at_centre - kProofRounding * (size + at_centre), 0.);
    range.high.proved = at_centre + kProofRounding * (size + at_centre);
    return range;
  }
  const std::optional<ProblemSubset> usable =
      problem.UsablePart({targets[0], targets[1]});
  if (!usable) return range;
  const double unit_length = unit ? length_of(problem.centre(), *unit) : 1;
  const auto measure = [&](const Estimate& estimate) {
    const double length = length_of(estimate, targets) *
                          (unit ? unit_length / length_of(estimate, *unit) : 1);
    range.low.reached = std::min(range.low.reached, length);
    range.high.reached = std::max(range.high.reached, length);
  };
  EndSearch search(problem, *usable, {targets[0], targets[1]}, tolerance,
                   context);
  const auto find_end = [&](const Eigen::Vector3d& along) {
    return search
        .FindEnd({{targets[1].kind, targets[1].index, along},
                  {targets[0].kind, targets[0].index, -along}},
                 measure)
        .proved;
  };
  const Eigen::Vector3d difference =
      DifferenceOf(whole, problem.centre(), targets);
  const Eigen::Vector3d u =
      at_centre > 0 ? difference.normalized() : Eigen::Vector3d::UnitX();
  const Eigen::Vector3d v = u.unitOrthogonal();
  // The largest absolute value of the difference along u, v and w.
  Eigen::Vector3d farthest = Eigen::Vector3d::Constant(at_centre);
  std::optional<double> least = at_centre;
  bool is_proved = true;
  const bool is_scale = IsScale(problem, targets);
  for (int axis = is_scale ? 1 : 0; axis < 3; ++axis) {
    const Eigen::Vector3d along = axis == 0   ? u
                                  : axis == 1 ? v
                                              : Eigen::Vector3d(u.cross(v));
    const std::optional<double> high = find_end(along);
    const std::optional<double> low = find_end(-along);
    is_proved = is_proved && high && low;
    if (!is_proved) break;
    farthest[axis] = std::max(*high, *low);
    if (axis == 0) least = -*low;
  }
  range.num_programmes = search.num_programmes();
  if (!is_proved) return range;
  range.low.proved = std::max(*least * (1 - kProofRounding), 0.);
  range.high.proved = farthest.norm() * (1 + kProofRounding);
  return range;
}

}  // namespace krot::internal
