#include "krot/outliers/packing.h"

#include <algorithm>
#include <numeric>
#include <optional>
#include <utility>

#include "krot/base/parallel_for.h"
#include "krot/bridge/built_part.h"
#include "krot/bridge/reprojection.h"
#include "krot/outliers/neighbourhood.h"
#include "krot/problem/components.h"
#include "krot/problem/subset.h"
#include "krot/sweeps/block_sweep.h"

namespace krot {
namespace {

// More open observations than these are tried with one other frame only.
constexpr size_t kMaxForMoreFrames = 2000;
// More tight observations than these are left alone.
constexpr size_t kMaxTight = 250;

class Packing {
 public:
  Packing(const Model& model, const BuiltProblem& built,
          const ErrorBound& bound, const Removal& removal,
          std::vector<Conflict> found, const Context& context)
      : model_(model),
        built_(built),
        problem_(built.problem),
        bound_(bound),
        removal_(removal),
        context_(context),
        is_free_(problem_.observations.size(), 1),
        is_taken_(problem_.observations.size(), 0),
        neighbourhoods_(problem_, removal.estimate) {
    small_context_ = context;
    small_context_.num_threads = 1;
    for (const int64_t i : removal.observations) is_free_[i] = 0;
    for (Conflict& conflict : found) Take(std::move(conflict));
  }

  std::vector<Conflict> Run();

 private:
  int32_t FrameOf(int64_t i) const {
    return problem_.views[problem_.observations[i].view].frame;
  }
  bool FitsIn(int64_t i, const std::vector<int32_t>& frames) const;
  std::optional<Conflict> Try(int64_t i,
                              const std::vector<int32_t>& frames) const;
  bool IsTaken(int64_t i) const { return is_taken_[i] != 0; }
  bool Charge(int64_t i, int num_others);
  void Charge(std::vector<std::pair<double, int64_t>>* open);
  void ChargeTight();
  void Take(Conflict conflict);

  const Model& model_;
  const BuiltProblem& built_;
  const KnownRotationProblem& problem_;
  const ErrorBound bound_;
  const Removal& removal_;
  const Context context_;
  Context small_context_;
  std::vector<char> is_free_;   // to make conflicts with others
  std::vector<char> is_taken_;  // by a conflict
  const Neighbourhoods neighbourhoods_;
  std::vector<Conflict> conflicts_;
};

// Whether observation i and the others of its point in the frames are within
// the bound where the frames stand, as all that stay are: then they are part of
// no conflict with these.
bool Packing::FitsIn(int64_t i, const std::vector<int32_t>& frames) const {
  const int32_t k = problem_.observations[i].point;
  std::vector<int64_t> observations;
  for (int64_t j = problem_.point_begin[k]; j < problem_.point_begin[k + 1];
       ++j) {
    const bool is_there =
        std::find(frames.begin(), frames.end(), FrameOf(j)) != frames.end() ||
        FrameOf(j) == FrameOf(i);
    if (j == i || (is_free_[j] && is_there)) observations.push_back(j);
  }
  const ProblemSubset subset(problem_, std::move(observations));
  Estimate estimate = subset.Restrict(removal_.estimate);
  return BlockSweep(subset.problem(), FastDescentOptions(), bound_.norm,
                    small_context_)
             .IntersectPoints(&estimate) <= bound_.max_error;
}

// A conflict of observation i in its frame and others.
std::optional<Conflict> Packing::Try(int64_t i,
                                     const std::vector<int32_t>& frames) const {
  if (FitsIn(i, frames)) return std::nullopt;
  const std::vector<int64_t> near = neighbourhoods_.Around(i, frames, is_free_);
  for (const std::vector<int64_t>& part :
       SplitIntoComponents(problem_, PruneUnconstrained(problem_, near))) {
    if (!std::binary_search(part.begin(), part.end(), i)) continue;
    const ProblemSubset subset(problem_, part);
    std::vector<int64_t> all(part.size());
    std::iota(all.begin(), all.end(), 0);
    std::optional<Conflict> conflict =
        FindConflict(model_, BuiltPart(built_, subset, built_.start), bound_,
                     all, small_context_);
    if (!conflict) return std::nullopt;
    conflict->observations = subset.InWhole(std::move(conflict->observations));
    conflict->proof.rows = InWhole(subset, std::move(conflict->proof.rows));
    return conflict;
  }
  return std::nullopt;
}

void Packing::Take(Conflict conflict) {
  for (const int64_t i : conflict.observations) {
    is_free_[i] = 0;
    is_taken_[i] = 1;
  }
  conflicts_.push_back(std::move(conflict));
}

// Looks in all the frames' sets at once and takes the first conflict in their
// order.
bool Packing::Charge(int64_t i, int num_others) {
  const std::vector<std::vector<int32_t>> sets =
      neighbourhoods_.FrameSets(i, num_others, is_free_);
  std::vector<std::optional<Conflict>> found(sets.size());
  ParallelFor(static_cast<int64_t>(sets.size()), 1, context_.num_threads,
              [&](int64_t n, int64_t, int) { found[n] = Try(i, sets[n]); });
  std::optional<Conflict>* smallest = nullptr;
  for (std::optional<Conflict>& conflict : found) {
    if (conflict &&
        (smallest == nullptr ||
         conflict->observations.size() < (*smallest)->observations.size())) {
      smallest = &conflict;
    }
  }
  if (smallest == nullptr) return false;
  Take(**smallest);
  return true;
}

// Those that are left open found no conflict of their own.
void Packing::Charge(std::vector<std::pair<double, int64_t>>* open) {
  for (const int num_others : {1, 2, 3}) {
    if (num_others > 1 && open->size() > kMaxForMoreFrames) return;
    std::vector<std::pair<double, int64_t>> left;
    for (const auto& removed : *open) {
      if (context_.IsCancelled() || IsTaken(removed.second)) continue;
      if (!Charge(removed.second, num_others)) left.push_back(removed);
    }
    *open = std::move(left);
  }
}

std::vector<Conflict> Packing::Run() {
  const Reprojection reprojection(model_, built_);
  std::vector<std::pair<double, int64_t>> open;  // -error, observation
  for (const int64_t i : removal_.observations) {
    if (IsTaken(i)) continue;
    open.emplace_back(-reprojection.Error(removal_.estimate, bound_.norm, i),
                      i);
  }
  std::sort(open.begin(), open.end());
  Charge(&open);
  for (const auto& removed : open) is_free_[removed.second] = 1;
  Charge(&open);
  ChargeTight();
  return std::move(conflicts_);
}

void Packing::ChargeTight() {
  std::vector<int64_t> tight;
  for (const int64_t i : removal_.tight) {
    if (is_free_[i]) tight.push_back(i);
  }
  if (tight.empty() || tight.size() > kMaxTight) return;
  const ProblemSubset subset(problem_, tight);
  const BuiltProblem part = BuiltPart(built_, subset, built_.start);
  std::vector<int64_t> all(tight.size());
  std::iota(all.begin(), all.end(), 0);
  for (Conflict& conflict :
       PackConflicts(model_, part, bound_, all, small_context_)) {
    conflict.observations = subset.InWhole(std::move(conflict.observations));
    conflict.proof.rows = InWhole(subset, std::move(conflict.proof.rows));
    Take(std::move(conflict));
  }
}

}  // namespace

std::vector<Conflict> PackAgainstRemoval(const Model& model,
                                         const BuiltProblem& built,
                                         const ErrorBound& bound,
                                         const Removal& removal,
                                         std::vector<Conflict> found,
                                         const Context& context) {
  return Packing(model, built, bound, removal, std::move(found), context).Run();
}

}  // namespace krot
