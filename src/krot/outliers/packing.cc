#include "krot/outliers/removal.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/reprojection.h"
#include "krot/problem/subset.h"
#include "krot/proof/certificate.h"
#include "krot/sweeps/res_int.h"

namespace krot::internal {
namespace {

class Packing {
 public:
  Packing(const Model& model, const BuiltProblem& built,
          const ErrorBound& bound, const Removal& removal,
          std::vector<Conflict> found, const Context& context, int64_t work)
      : model_(model),
        built_(built),
        problem_(built.problem),
        bound_(bound),
        removal_(removal),
        context_(context),
        is_free_(problem_.observations.size(), 1),
        is_taken_(problem_.observations.size(), 0),
        neighbourhoods_(problem_, removal.estimate),
        two_views_(problem_, removal.estimate, bound.max_error) {
    work_.limit = work * static_cast<int64_t>(problem_.observations.size());
    small_context_ = context;
    small_context_.num_threads = 1;
    for (const int64_t i : removal.observations) is_free_[i] = 0;
    for (Conflict& conflict : found) Take(std::move(conflict));
  }

  ConflictPacking Run() {
    const Reprojection reprojection(model_, built_);
    std::vector<std::pair<double, int64_t>> by_error;
    for (const int64_t i : removal_.observations) {
      if (IsTaken(i)) continue;
      by_error.emplace_back(
          reprojection.Error(removal_.estimate, bound_.norm, i), i);
    }
    std::sort(by_error.begin(), by_error.end());
    std::vector<int64_t> open;
    for (const auto& [error, i] : by_error) open.push_back(i);
    Charge(&open);
    for (const int64_t i : open) is_free_[i] = 1;
    Charge(&open);
    return {std::move(conflicts_), is_complete_};
  }

 private:
  // Whether a point brings observation i and its other observations in the
  // frames within the bound, the frames fixed. All observations that stay are
  // within it, too, so that there is no conflict with them in these frames.
  bool FitsIn(int64_t i, const std::vector<int32_t>& frames) const {
    const int32_t k = problem_.observations[i].point;
    std::vector<int64_t> observations;
    for (const int64_t j : problem_.OfPoint(k)) {
      const bool is_there = std::find(frames.begin(), frames.end(),
                                      problem_.FrameOf(j)) != frames.end() ||
                            problem_.FrameOf(j) == problem_.FrameOf(i);
      if (j == i || (is_free_[j] && is_there)) observations.push_back(j);
    }
    const ProblemSubset subset(problem_, std::move(observations));
    Estimate estimate = subset.Restrict(removal_.estimate);
    return BlockSweep(subset.problem(), FastDescentOptions(), bound_.norm,
                      small_context_)
               .IntersectPoints(&estimate) <= bound_.max_error;
  }

  // Looks for a conflict in the connected part of `near` (ascending) with i.
  std::optional<Conflict> Refute(int64_t i, const std::vector<int64_t>& near,
                                 Work* work) const {
    for (const std::vector<int64_t>& part :
         SplitIntoComponents(problem_, PruneUnconstrained(problem_, near))) {
      if (!std::binary_search(part.begin(), part.end(), i)) continue;
      return FindConflict(model_, built_, bound_, part, small_context_, work);
    }
    return std::nullopt;
  }

  // Looks for a conflict of observation i in its frame and others.
  std::optional<Conflict> Try(int64_t i, const std::vector<int32_t>& frames,
                              Work* work) const {
    if (FitsIn(i, frames)) return std::nullopt;
    return Refute(i, neighbourhoods_.Around(i, frames, is_free_), work);
  }

  bool Prove(Conflict* conflict, Work* work) const {
    return ProveConflict(model_, built_, bound_, small_context_, conflict,
                         work);
  }
  // Reports progress. False at the limit of work, or if cancelled.
  bool MayGoOn() {
    context_.Stage("conflicts of removed observations",
                   static_cast<int64_t>(conflicts_.size()),
                   static_cast<int64_t>(removal_.observations.size()));
    is_complete_ = is_complete_ && !work_.IsUsedUp();
    return is_complete_ && !context_.IsCancelled();
  }
  bool IsTaken(int64_t i) const { return is_taken_[i] != 0; }

  std::optional<Conflict> InTwoViews(int64_t i, Work* work) const {
    std::vector<std::vector<int64_t>> sets;
    const Observation& own = problem_.observations[i];
    for (const int64_t j : problem_.OfPoint(own.point)) {
      const bool is_twin = j != i && problem_.observations[j].view == own.view;
      if (is_twin && is_free_[j]) {
        sets.push_back({std::min(i, j), std::max(i, j)});
      }
    }
    for (std::vector<int64_t>& set : two_views_.Candidates(i, is_free_)) {
      sets.push_back(std::move(set));
    }
    for (const std::vector<int64_t>& set : sets) {
      std::optional<Conflict> conflict = Refute(i, set, work);
      if (conflict && Prove(&*conflict, work)) return conflict;
    }
    return std::nullopt;
  }

  // What search(n, &work) finds for each n < count, all at once.
  template <typename Search>
  std::vector<std::optional<Conflict>> SearchAll(size_t count,
                                                 const Search& search) {
    std::vector<std::optional<Conflict>> found(count);
    std::vector<Work> work(count);
    ParallelFor(
        SignedSize(found), 1, context_.num_threads,
        [&](int64_t n, int64_t, int) { found[n] = search(n, &work[n]); });
    for (const Work& own : work) work_.done += own.done;
    return found;
  }

  // Observations left in `open` found no conflict. Those whose conflict shares
  // observations with one found at the same time search again.
  void ChargeInTwoViews(std::vector<int64_t>* open) {
    std::vector<int64_t> queue(open->rbegin(), open->rend());
    std::vector<int64_t> left;
    while (!queue.empty() && MayGoOn()) {
      std::vector<int64_t> batch;
      while (batch.size() < 16 && !queue.empty()) {
        if (!IsTaken(queue.back())) batch.push_back(queue.back());
        queue.pop_back();
      }
      std::vector<std::optional<Conflict>> found = SearchAll(
          batch.size(),
          [&](int64_t n, Work* work) { return InTwoViews(batch[n], work); });
      std::vector<int64_t> again;
      for (size_t n = 0; n < batch.size(); ++n) {
        if (!found[n]) {
          left.push_back(batch[n]);
        } else if (std::any_of(found[n]->observations.begin(),
                               found[n]->observations.end(),
                               [this](int64_t i) { return IsTaken(i); })) {
          again.push_back(batch[n]);
        } else {
          Take(*std::move(found[n]));
        }
      }
      queue.insert(queue.end(), again.rbegin(), again.rend());
    }
    left.insert(left.end(), queue.rbegin(), queue.rend());
    *open = std::move(left);
  }

  // Looks in all sets of frames at once and takes the smallest conflict that is
  // proved.
  bool Charge(int64_t i, int num_others) {
    const std::vector<std::vector<int32_t>> sets =
        neighbourhoods_.FrameSets(i, num_others, is_free_);
    std::vector<std::optional<Conflict>> found =
        SearchAll(sets.size(),
                  [&](int64_t n, Work* work) { return Try(i, sets[n], work); });
    std::vector<std::pair<size_t, size_t>> smallest_first;
    for (size_t n = 0; n < found.size(); ++n) {
      if (found[n])
        smallest_first.emplace_back(found[n]->observations.size(), n);
    }
    std::sort(smallest_first.begin(), smallest_first.end());
    for (const auto& [size, n] : smallest_first) {
      if (!Prove(&*found[n], &work_)) continue;
      Take(*std::move(found[n]));
      return true;
    }
    return false;
  }

  // Observations left in `open` found no conflict. Only those with the largest
  // errors are tried: others hardly ever find a conflict in more frames.
  void ChargeInFrames(std::vector<int64_t>* open) {
    for (const int num_others : {2, 3}) {
      std::vector<int64_t> left;
      const size_t first = open->size() - std::min<size_t>(open->size(), 400);
      for (size_t n = 0; n < open->size(); ++n) {
        const int64_t i = (*open)[n];
        if (IsTaken(i)) continue;
        const bool is_tried = n >= first && MayGoOn();
        if (!is_tried || !Charge(i, num_others)) left.push_back(i);
      }
      *open = std::move(left);
    }
  }

  // Conflicts of two views are the smallest, but take three observations of the
  // open one's view; conflicts of more views may take two, so crowded views try
  // these first.
  void Charge(std::vector<int64_t>* open) {
    std::vector<int64_t> crowded = TakeCrowded(problem_, is_free_, open);
    ChargeInFrames(&crowded);
    ChargeInTwoViews(open);
    ChargeInTwoViews(&crowded);
    ChargeInFrames(open);
    open->insert(open->begin(), crowded.begin(), crowded.end());
  }

  void Take(Conflict conflict) {
    for (const int64_t i : conflict.observations) {
      is_free_[i] = 0;
      is_taken_[i] = 1;
    }
    conflicts_.push_back(std::move(conflict));
  }

  const Model& model_;
  const BuiltProblem& built_;
  const KnownRotationProblem& problem_;
  const ErrorBound bound_;
  const Removal& removal_;
  const Context context_;
  Context small_context_;
  Work work_;
  bool is_complete_ = true;
  std::vector<char> is_free_;   // to make conflicts with others
  std::vector<char> is_taken_;  // by a conflict
  const Neighbourhoods neighbourhoods_;
  const TwoViewConflicts two_views_;
  std::vector<Conflict> conflicts_;
};

}  // namespace

ConflictPacking PackAgainstRemoval(
    const Model& model, const BuiltProblem& built, const ErrorBound& bound,
    const Removal& removal, std::vector<Conflict> found, const Context& context,
    int64_t work_per_observation) {
  return Packing(model, built, bound, removal, std::move(found), context,
                 work_per_observation)
      .Run();
}

}  // namespace krot::internal
