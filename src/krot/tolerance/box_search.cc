#include "krot/tolerance/tolerance_analysis.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "krot/joint/working_set.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

// The working set begins with so many ties of every frame
// (WorkingSet::AddTies), and takes twice as many until it is connected.
constexpr int kFirstTies = 20;
// A round adds at most so many times the points that the set has.
constexpr int kGrowth = 2;
constexpr int kMaxRounds = 12;
// Bisection along the segment from the centre ends with this share of it.
constexpr double kSegmentStep = 1.0 / 1024;

class BoxSearch {
 public:
  BoxSearch(const ToleranceProblem& shared, const ProblemSubset& usable,
            const Pull& target, double tolerance, const Context& context)
      : shared_(shared),
        usable_(usable),
        target_(target),
        tolerance_(tolerance),
        context_(context),
        reprojection_(shared.model(), shared.built()),
        set_(usable.problem()),
        usables_(shared.problem()) {
    for (int32_t k = 0; k < shared.problem().num_points; ++k) {
      if (usable.FindPoint(k)) usables_.AddPoint(k);
    }
    if (target.kind == Pull::Kind::kPoint) {
      set_.AddPoint(*usable.FindPoint(target.index));
    }
    set_.AddTies(num_ties_);
  }

  // Along the target's axis, `sign` being 1 or -1.
  BoxEnd FindEnd(int axis, double sign) {
    Pull pull = target_;
    pull.direction = sign * Eigen::Vector3d::Unit(axis);
    const double at_centre = Along(shared_.problem(), shared_.centre(), pull);
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
          part.problem(), *InPart(part, *InPart(usable_, pull)), scale, options,
          context_, part.Restrict(usable_.Restrict(shared_.centre())));
      ++num_programmes_;
      if (extent.proved) {
        end.proved =
            std::min(*extent.proved, end.proved.value_or(*extent.proved));
      }
      Estimate of_usable;
      const Estimate far_end = Complete(part, extent.estimate, &of_usable);
      end.reached = std::max(end.reached, ReachAllowed(pull, far_end));
      if (end.proved &&
          *end.proved - end.reached <= tolerance_ * (*end.proved - at_centre)) {
        break;
      }
      if (set_.IsAll()) break;
      if (round == kMaxRounds) {
        set_.AddAll();
      } else if (set_.AddAbove(of_usable, shared_.norm(),
                               (1 + kErrorRounding) * shared_.bound(),
                               kGrowth * set_.num_points()) == 0) {
        break;
      }
    }
    end.reached *= sign;
    if (end.proved) *end.proved *= sign;
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
      if (set_.IsAll() ||
          (holds(target_) && (!shared_.scale() || holds(*shared_.scale())))) {
        return part;
      }
      num_ties_ *= 2;
      set_.AddTies(num_ties_);
      if (num_ties_ > problem().num_points) set_.AddAll();
    }
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

  // The whole estimate that has the set's, and all other points where they fit
  // in best.
  Estimate Complete(const ProblemSubset& part, const Estimate& estimate,
                    Estimate* of_usable) const {
    Estimate whole = shared_.centre();
    *of_usable = usable_.Restrict(whole);
    part.Replace(estimate, of_usable);
    PlaceOthers(problem(), set_, of_usable);
    usable_.Replace(*of_usable, &whole);
    PlaceOthers(shared_.problem(), usables_, &whole);
    return whole;
  }

  // p'x of the farthest estimate on the segment from the centre whose true
  // errors are all within the bound.
  double ReachAllowed(const Pull& pull, const Estimate& far_end) const {
    const auto is_allowed = [&](const Estimate& estimate) {
      return reprojection_.TrueCost(estimate, shared_.norm(),
                                    context_.num_threads) <= shared_.bound();
    };
    const auto reach = [&](const Estimate& estimate) {
      return Along(shared_.problem(), estimate, pull);
    };
    if (is_allowed(far_end)) return reach(far_end);
    double allowed = 0;
    for (double step = 0.5; step >= kSegmentStep; step /= 2) {
      if (is_allowed(Between(shared_.centre(), far_end, allowed + step))) {
        allowed += step;
      }
    }
    return reach(Between(shared_.centre(), far_end, allowed));
  }

  const ToleranceProblem& shared_;
  const ProblemSubset& usable_;
  const Pull target_;
  const double tolerance_;
  const Context context_;
  const Reprojection reprojection_;
  WorkingSet set_;      // of the usable part
  WorkingSet usables_;  // all points of the usable part, in the whole
  int num_ties_ = kFirstTies;
  int64_t num_programmes_ = 0;
};

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
  const std::optional<ProblemSubset> usable = problem.UsablePart(target);
  if (!usable) return box;
  BoxSearch search(problem, *usable, target, tolerance, context);
  for (int axis = 0; axis < 3; ++axis) {
    box.low[axis] = search.FindEnd(axis, -1);
    box.high[axis] = search.FindEnd(axis, 1);
  }
  box.num_programmes = search.num_programmes();
  return box;
}

}  // namespace krot::internal
