#include "krot/outliers/conflict.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <utility>

#include "krot/bridge/built_part.h"
#include "krot/problem/components.h"
#include "krot/problem/subset.h"
#include "krot/proof/certificate.h"

namespace krot::internal {
namespace {

std::vector<int64_t> Without(const std::vector<int64_t>& from,
                             const std::vector<int64_t>& what) {
  std::vector<int64_t> rest;
  std::set_difference(from.begin(), from.end(), what.begin(), what.end(),
                      std::back_inserter(rest));
  return rest;
}

std::vector<std::vector<int64_t>> Parts(
    const BuiltProblem& built, const std::vector<int64_t>& observations) {
  return SplitIntoComponents(built.problem,
                             PruneUnconstrained(built.problem, observations));
}

// Larger supports stay as they are: deletion would take as many solves.
constexpr size_t kMaxDeletions = 60;

// Makes a refuted support irreducible, within its own small problem.
class Deletion {
 public:
  Deletion(const Model& model, BuiltProblem support, const ErrorBound& bound,
           const Context& context, Work* work)
      : model_(model),
        built_(std::move(support)),
        bound_(bound),
        context_(context),
        work_(work),
        kept_(built_.pixels.size()) {
    std::iota(kept_.begin(), kept_.end(), 0);
  }

  // False if an observation is kept only because nothing was decided.
  bool Run() {
    if (kept_.size() > kMaxDeletions) return false;
    bool is_irreducible = true;
    std::vector<int64_t> untried = kept_;
    while (!untried.empty() && !context_.IsCancelled()) {
      const int64_t spared = untried.back();
      untried.pop_back();
      bool is_feasible = true;
      for (const std::vector<int64_t>& part :
           Parts(built_, Without(kept_, {spared}))) {
        const ProblemSubset subset(built_.problem, part);
        Decision decision =
            Decide(model_, BuiltPart(built_, subset, built_.start), bound_,
                   context_, work_);
        is_feasible = is_feasible && decision.is_feasible;
        if (!decision.is_refuted) continue;
        is_feasible = true;
        kept_ = subset.InWhole(std::move(decision.support));
        std::vector<int64_t> left;
        std::set_intersection(untried.begin(), untried.end(), kept_.begin(),
                              kept_.end(), std::back_inserter(left));
        untried = std::move(left);
        break;
      }
      is_irreducible = is_irreducible && is_feasible;
    }
    return is_irreducible;
  }

  const std::vector<int64_t>& kept() const { return kept_; }

 private:
  const Model& model_;
  const BuiltProblem built_;
  const ErrorBound bound_;
  const Context context_;
  Work* const work_;
  std::vector<int64_t> kept_;  // ascending
};

}  // namespace

std::optional<Conflict> FindConflict(const Model& model,
                                     const BuiltProblem& built,
                                     const ErrorBound& bound,
                                     const std::vector<int64_t>& observations,
                                     const Context& context, Work* work) {
  const ProblemSubset subset(built.problem, observations);
  const BuiltProblem part = BuiltPart(built, subset, built.start);
  const Decision first = Decide(model, part, bound, context, work);
  if (!first.is_refuted) return std::nullopt;

  const ProblemSubset support(part.problem, first.support);
  Deletion deletion(model, BuiltPart(part, support, part.start), bound, context,
                    work);
  Conflict conflict;
  conflict.is_irreducible = deletion.Run();
  conflict.observations = subset.InWhole(support.InWhole(deletion.kept()));
  return conflict;
}

bool ProveConflict(const Model& model, const BuiltProblem& built,
                   const ErrorBound& bound, const Context& context,
                   Conflict* conflict, Work* work) {
  const ProblemSubset subset(built.problem, conflict->observations);
  const BuiltProblem part = BuiltPart(built, subset, built.start);
  const Decision decision = Decide(model, part, bound, context, work);
  if (!decision.is_refuted) return false;
  std::optional<PixelCertificate> proof =
      ProveRefutation(model, part, bound, decision, context, work);
  if (!proof) return false;
  conflict->proof = *std::move(proof);
  conflict->proof.rows = InWhole(subset, std::move(conflict->proof.rows));
  conflict->observations.clear();
  for (const CertifiedObservation& o : conflict->proof.rows.observations) {
    conflict->observations.push_back(o.observation);
  }
  return true;
}

std::vector<Conflict> PackConflicts(const Model& model,
                                    const BuiltProblem& built,
                                    const ErrorBound& bound,
                                    const std::vector<int64_t>& observations,
                                    const Context& context, Work* work) {
  std::vector<Conflict> conflicts;
  std::vector<std::vector<int64_t>> open = Parts(built, observations);
  while (!open.empty() && !work->IsUsedUp() && !context.IsCancelled()) {
    const std::vector<int64_t> part = std::move(open.back());
    open.pop_back();
    std::optional<Conflict> conflict =
        FindConflict(model, built, bound, part, context, work);
    if (!conflict ||
        !ProveConflict(model, built, bound, context, &*conflict, work)) {
      continue;
    }
    for (std::vector<int64_t>& rest :
         Parts(built, Without(part, conflict->observations))) {
      open.push_back(std::move(rest));
    }
    conflicts.push_back(*std::move(conflict));
  }
  return conflicts;
}

}  // namespace krot::internal
