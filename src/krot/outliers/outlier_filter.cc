#include "krot/outliers/outlier_filter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/base/check.h"
#include "krot/base/context.h"
#include "krot/base/numbers.h"
#include "krot/model/derived_models.h"
#include "krot/outliers/parts.h"
#include "krot/outliers/removal.h"
#include "krot/outliers/robust_start.h"
#include "krot/problem/gauge.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

// The ids of these observations' points; ascending.
std::vector<uint64_t> PointIds(const Model& model, const BuiltProblem& built,
                               const std::vector<int64_t>& observations) {
  std::vector<uint64_t> ids;
  for (const int64_t i : observations) {
    const int32_t point = built.problem.observations[i].point;
    ids.push_back(model.points3D[built.point_of[point]].id);
  }
  SortUnique(&ids);
  return ids;
}

class OutlierFilter : private Filtering {
  using Spared = OutlierFilterOptions::Spared;

 public:
  OutlierFilter(const Model& model, const OutlierFilterOptions& options,
                const Context& context)
      : Filtering(model, options, context),
        bound_{options.solve.norm, options.max_error.value_or(0)} {}

  OutlierFilterResult Run() {
    FilterByConflicts();
    summary_.max_error = bound_.max_error;
    if (context_.IsCancelled()) return {model_, std::move(summary_)};
    if (is_given_back_) {
      summary_.is_within = true;
      summary_.pixel_error_after = summary_.pixel_error_before;
      return {model_, std::move(summary_)};
    }
    const std::vector<double> errors = Describe();
    UpdatePointErrors(errors, &kept_.model);
    summary_.is_within = AreWithin(errors);
    if (options_.solve.polish != Polish::kNone && summary_.solve) {
      summary_.solve->polish =
          PolishModel(options_.solve.polish, options_.solve.finish.loss,
                      options_.solve.problem.fixed, context_, &kept_.model);
    }
    return {std::move(kept_.model), std::move(summary_)};
  }

 private:
  bool IsWithin(double error) const {  // rounding counts for nothing
    return error <= (1 + 1e-9) * bound_.max_error;
  }

  bool AreWithin(const std::vector<double>& errors) const {
    return std::all_of(errors.begin(), errors.end(),
                       [this](double error) { return IsWithin(error); });
  }

  void FilterByConflicts() {
    const RemovalStart start = FindRemovalStart(model_, options_, context_);
    const BuiltProblem& built = start.built;
    summary_.init = start.init;
    const bool is_all_spared = options_.spared == Spared::kEverything;
    if (is_all_spared || (options_.spared == Spared::kWhatFitsItsPositions &&
                          start.fits_its_positions)) {
      is_given_back_ = summary_.is_spared = true;
      if (start.nearly_fits) summary_.spared_start = built.start;
      return;
    }
    bound_.max_error = start.max_error;
    summary_.is_bound_beyond_reason =
        !options_.max_error && start.max_error > options_.solve.init_max_error;
    if (start.nearly_fits && (KeepsAll(built) || context_.IsCancelled())) {
      return;
    }
    const std::vector<uint64_t> elements = ElementsOf(model_, built);
    std::vector<Conflict> found;
    const std::optional<Removal> removal = RemoveFew(built, &found);
    if (context_.IsCancelled()) return;
    if (!removal) {
      is_given_back_ = true;
      summary_.conflicts =
          DescribeConflicts(model_, built, options_.solve.norm,
                            summary_.noise->limit.max_error, {});
      return;
    }
    for (const int64_t i : removal->observations) is_removed_[elements[i]] = 1;
    if (IsEnough()) RemoveChancePairs(model_, &is_removed_);
    if (options_.find_conflicts) {
      Pack(built, *removal, std::move(found), elements);
    }
    if (options_.on_removed) {
      options_.on_removed(static_cast<int64_t>(removal->observations.size()));
    }
    Solve(PlacedAt(built, *removal));
    // Observations that had no part in the problem may still be above the
    // bound.
    if (RemoveAbove()) {
      std::vector<char> is_gone;
      for (const uint64_t e : kept_.element_of) {
        is_gone.push_back(is_removed_[e]);
      }
      RemoveMore(is_gone);
    }
    if (start.init == SolveInit::kFeasible && !context_.IsCancelled()) {
      FindWeakParts(built);
    }
  }

  // Whether all observations can be within the bound that noise has chosen. If
  // so, they are.
  bool KeepsAll(const BuiltProblem& built) {
    Solve(PlacedAt(built, {{}, built.start}));
    if (context_.IsCancelled() ||
        !AreWithin(PixelErrors(kept_.model, context_.num_threads))) {
      return false;
    }
    FindWeakParts(built);
    return true;
  }

  // Whether the removal need not be the smallest: a robust start leaves few
  // above the bound already, and programmes would take ten times as long to
  // find a two-hundredth fewer, and do not hold parts' scales.
  bool IsEnough() const {
    return summary_.init == SolveInit::kFeasible && !options_.find_conflicts;
  }

  // Chooses what to remove. Conflicts that this finds on the way go to `found`.
  // Where noise is to choose the bound, it is set here, or none is returned if
  // noise explains all errors.
  std::optional<Removal> RemoveFew(const BuiltProblem& built,
                                   std::vector<Conflict>* found) {
    if (built.pixels.empty()) return Removal{{}, built.start};
    if (options_.make_profile) return MakeProfile(built, found);
    if (bound_.max_error == 0) {
      MeasureNoise(built);
      if (summary_.noise->ExplainsAll()) return std::nullopt;
      bound_.max_error = summary_.noise->limit.max_error;
    }
    const Timer timer;
    Removal removal = FindRemoval(model_, built, bound_, context_,
                                  IsEnough() ? 0 : kMaxProgrammes);
    if (IsEnough() && !options_.max_error) bound_.max_error *= kRoomOfFinish;
    summary_.seconds_removal = timer.Seconds();
    return removal;
  }

  // The removal of the profile's last level or, where no bound was given, of
  // its elbow.
  std::optional<Removal> MakeProfile(const BuiltProblem& built,
                                     std::vector<Conflict>* found) {
    const Timer timer;
    ErrorProfile profile = FindErrorProfile(
        model_, built, {bound_.norm, options_.max_error}, context_);
    ErrorProfileSummary& summary = summary_.profile.emplace();
    for (const ProfileLevel& level : profile.levels) {
      summary.levels.push_back(
          {static_cast<int64_t>(level.removal.observations.size()),
           level.max_error, level.lower_bound, level.num_proved,
           PointIds(model_, built, level.removal.observations)});
    }
    summary.elbow = profile.elbow;
    summary.seconds = timer.Seconds();
    summary_.noise = NoiseSummary{profile.noise, profile.levels[0].max_error,
                                  profile.levels[0].lower_bound};
    size_t chosen = profile.levels.size() - 1;
    if (!options_.max_error) {
      if (!profile.elbow) return std::nullopt;
      chosen = *profile.elbow;
      bound_.max_error = profile.noise.max_error;
    }
    for (Conflict& conflict : profile.conflicts) {
      if (conflict.proof.lower_bound > bound_.max_error) {
        found->push_back(std::move(conflict));
      }
    }
    return std::move(profile.levels[chosen].removal);
  }

  void MeasureNoise(const BuiltProblem& built) {
    NoiseSummary& noise = summary_.noise.emplace();
    noise.limit = FindNoiseLimit(model_, built, bound_.norm, context_);
    const OptimumWithout lowest =
        SolveWithout(model_, built, {}, built.start, bound_.norm,
                     context_.Within("comparing the errors with noise"));
    noise.lowest_max_error = lowest.max_error;
    noise.lower_bound = lowest.lower_bound;
  }

  void Pack(const BuiltProblem& built, const Removal& removal,
            std::vector<Conflict> found,
            const std::vector<uint64_t>& elements) {
    const Timer timer;
    ConflictPacking packing = PackAgainstRemoval(model_, built, bound_, removal,
                                                 std::move(found), context_);
    summary_.is_search_complete = packing.is_complete;
    if (context_.IsCancelled()) return;
    summary_.rotation_suspect = FindRotationSuspect(
        model_, built, bound_, packing.conflicts, removal, context_);
    TakeConflicts(built, elements, bound_, std::move(packing.conflicts));
    summary_.seconds_conflicts = timer.Seconds();
  }

  // A copy of the input at the removal's estimate, in the input's frame.
  Model PlacedAt(const BuiltProblem& built, const Removal& removal) {
    Estimate placed = removal.estimate;
    const ProblemSubset part(built.problem,
                             AllBut(removal.observations, built.pixels.size()));
    Estimate own = part.Restrict(placed);
    RestoreGaugeIfHarmless(part.problem(),
                           part.Restrict(OwnEstimate(model_, built)),
                           options_.solve.norm, context_, &own);
    part.Replace(own, &placed);
    return ApplyEstimate(model_, built, placed);
  }

  // Solves what is left of a model that differs from the input in translations
  // and points alone.
  void Solve(Model moved) {
    const Timer timer;
    kept_ = RemoveObservations(moved, is_removed_);
    if (!kept_.model.track_elements.empty()) {
      // If all that is left can be within the bound, its least squares below
      // that.
      SolveModelOptions options = options_.solve;
      options.init = SolveInit::kModel;
      options.polish = Polish::kNone;
      options.finish.max_error = bound_.max_error;
      SolveModelResult solved = SolveModel(kept_.model, options, context_);
      kept_.model = std::move(solved.model);
      summary_.solve = std::move(solved.summary);
      ++summary_.num_solves;
    }
    summary_.seconds_solve += timer.Seconds();
  }

  // Removes what is above the bound in the solved model. Returns whether any
  // was.
  bool RemoveAbove() {
    const std::vector<double> errors =
        PixelErrors(kept_.model, context_.num_threads);
    bool is_any = false;
    for (size_t n = 0; n < errors.size(); ++n) {
      if (IsWithin(errors[n])) continue;
      is_removed_[kept_.element_of[n]] = 1;
      is_any = true;
    }
    return is_any;
  }

  // Looks for weakly tied parts in the solved model, by all tracks of the
  // input, for loose frames and for what moves softly among what is held so
  // far. Without baselines all of it would be noise.
  void FindWeakParts(const BuiltProblem& built) {
    if (!summary_.is_bound_beyond_reason) {
      BuildProblemOptions build = options_.solve.problem;
      build.num_threads = context_.num_threads;
      const BuiltProblem solved = BuildProblem(kept_.model, build);
      summary_.one_centre_turn_deg =
          FindTurnAtOneCentre(solved.problem, solved.start, context_);
      if (summary_.one_centre_turn_deg) return;
    }
    Estimate estimate = built.start;
    for (size_t f = 0; f < built.frame_of.size(); ++f) {
      estimate.translations[f] =
          kept_.model.frames[built.frame_of[f]].rig_from_world.translation;
    }
    const double cap = kCapOfPoints * std::min(bound_.max_error, kLevelOfStart);
    const std::vector<char> kept = AreKept(built);
    std::vector<char> is_held(built.problem.num_frames, 1);
    const auto add = [&](const WeakLink& link) {
      for (const int32_t f : link.frames) is_held[f] &= link.IsHeld();
      WeakPart& part = AddWeakPart(built, link.frames);
      part.num_tracks = link.num_tracks;
      part.num_of_three = link.num_of_three;
      part.num_agreeing = link.num_agreeing;
      part.scale_factor = link.scale_factor;
      part.is_held = link.IsHeld();
      part.turn_deg = link.turn_deg;
      part.num_agreeing_turned = link.num_agreeing_turned;
    };
    for (const WeakLink& link :
         FindWeakLinks(built.problem, estimate, kept, cap, context_)) {
      add(link);
    }
    FindLooseFrames(built, kept, &is_held);
    for (;;) {
      std::vector<char> counts = kept;
      for (size_t i = 0; i < kept.size(); ++i) {
        counts[i] &= is_held[built.problem.FrameOf(static_cast<int64_t>(i))];
      }
      const std::optional<WeakLink> soft =
          FindSoftPart(built.problem, estimate, counts, cap, context_);
      if (!soft || soft->IsHeld() || context_.IsCancelled()) return;
      add(*soft);
    }
  }

  // Adds single frames that keep less than half of the usual share of their
  // observations, and fewer than chance explains (four standard deviations).
  // These are not held.
  void FindLooseFrames(const BuiltProblem& built, const std::vector<char>& kept,
                       std::vector<char>* is_held) {
    const KnownRotationProblem& problem = built.problem;
    const double usual =
        static_cast<double>(std::count(kept.begin(), kept.end(), 1)) /
        static_cast<double>(kept.size());
    for (int32_t f = 0; f < problem.num_frames; ++f) {
      int64_t num_kept = 0;
      for (const int32_t i : problem.OfFrame(f)) num_kept += kept[i];
      const int64_t num_seen =
          problem.frame_begin[f + 1] - problem.frame_begin[f];
      const double expected = usual * static_cast<double>(num_seen);
      const double missing = expected - static_cast<double>(num_kept);
      if (2 * missing <= expected ||
          missing <= 4 * std::sqrt((1 - usual) * expected)) {
        continue;
      }
      WeakPart& part = AddWeakPart(built, {f});
      part.is_frame = true;
      part.num_tracks = num_seen;
      part.num_agreeing = num_kept;
      part.is_held = false;
      (*is_held)[f] = 0;
    }
  }

  // Whether each observation of the problem is left in the solved model.
  std::vector<char> AreKept(const BuiltProblem& built) const {
    std::vector<char> is_left(model_.track_elements.size(), 0);
    for (const uint64_t e : kept_.element_of) is_left[e] = 1;
    std::vector<char> kept;
    for (const uint64_t e : ElementsOf(model_, built)) {
      kept.push_back(is_left[e]);
    }
    return kept;
  }

  // `frames` must ascend.
  WeakPart& AddWeakPart(const BuiltProblem& built,
                        const std::vector<int32_t>& frames) {
    WeakPart& part = summary_.weak_parts.emplace_back();
    for (size_t v = 0; v < built.image_of.size(); ++v) {
      if (std::binary_search(frames.begin(), frames.end(),
                             built.problem.views[v].frame)) {
        part.image_names.push_back(model_.images[built.image_of[v]].name);
      }
    }
    return part;
  }

  ErrorBound bound_;
  bool is_given_back_ = false;  // nothing is removed, the model is the input
};

}  // namespace

OutlierFilterResult FilterOutliers(const Model& model,
                                   const OutlierFilterOptions& options,
                                   const Context& context) {
  CheckArgument(!options.max_error || *options.max_error > 0, "max_error",
                options.max_error.value_or(0), "> 0");
  CheckArgument(
      !options.make_profile || options.method == OutlierMethod::kConflicts,
      "make_profile", options.make_profile, "false with this method");
  CheckArgument(options.solve.norm.p == 2, "norm.p", options.solve.norm.p,
                "2, that of pixel errors");
  CheckArgument(options.solve.problem.positions.empty(),
                "solve.problem.positions", "some", "none");
  CheckArgument(!options.solve.problem.fixed.Any(), "solve.problem.fixed",
                "something", "empty: everything moves");
  OutlierFilterResult result =
      InLocalFrame(LocalFrame(model), model, [&](const Model& local) {
        if (options.method == OutlierMethod::kSnooping) {
          return FilterBySnooping(local, options, context);
        }
        return OutlierFilter(local, options, context).Run();
      });
  const bool is_given_back =
      result.summary.noise && result.summary.max_error == 0;
  if (is_given_back) result.model = model;  // to the last bit
  return result;
}

}  // namespace krot::internal
