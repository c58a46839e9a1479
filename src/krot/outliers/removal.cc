#include "krot/outliers/removal.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/bridge/built_part.h"
#include "krot/bridge/reprojection.h"
#include "krot/conic/excess_program.h"
#include "krot/outliers/reweighting.h"
#include "krot/problem/components.h"
#include "krot/problem/subset.h"
#include "krot/sweeps/block_sweep.h"

namespace krot {
namespace {

// Of the bound: what the interior point leaves open.
constexpr double kInside = 1e-3;
constexpr int kMaxReweightings = 4;
// Of the bound, where their interior point ends.
constexpr double kRemovalMu = 1e-3;
// In units of the bound: what an error at the start counts for at most.
constexpr double kLargestExcess = 100;
// Observations with less of a multiplier have no say.
constexpr double kSmallPrice = 1e-2;

class RemovalSearch {
 public:
  RemovalSearch(const Model& model, const BuiltProblem& built,
                const ErrorBound& bound, const Context& context)
      : built_(built),
        bound_(bound),
        context_(context),
        reprojection_(model, built),
        rows_(built.problem) {}

  Removal Run();

 private:
  double Error(const Estimate& estimate, int64_t i) const {
    return reprojection_.Error(estimate, bound_.norm, i);
  }
  std::vector<int64_t> Above(const Estimate& estimate) const;
  std::vector<double> WeightsAtStart() const;
  void Excess(const std::vector<int64_t>& component, Estimate* estimate);
  void Offer(const Estimate& estimate);
  bool TakeBack();

  const BuiltProblem& built_;
  const ErrorBound bound_;
  const Context context_;
  const Reprojection reprojection_;
  KnownRotationProblem rows_;
  std::vector<double> weights_;
  std::vector<char> is_tight_;
  Removal best_;
};

std::vector<int64_t> RemovalSearch::Above(const Estimate& estimate) const {
  std::vector<int64_t> above;
  for (size_t i = 0; i < rows_.observations.size(); ++i) {
    const int64_t observation = static_cast<int64_t>(i);
    if (!(Error(estimate, observation) <= bound_.max_error)) {
      above.push_back(observation);
    }
  }
  return above;
}

std::vector<double> RemovalSearch::WeightsAtStart() const {
  std::vector<double> excess;
  for (size_t i = 0; i < rows_.observations.size(); ++i) {
    const double error = Error(built_.start, static_cast<int64_t>(i));
    excess.push_back(std::clamp(error - bound_.max_error, 0.0,
                                kLargestExcess * bound_.max_error));
  }
  return WeightsAgainst(excess, bound_.max_error);
}

// Solves a component's programme, with rows as they are, and sets the weights
// of the next.
void RemovalSearch::Excess(const std::vector<int64_t>& component,
                           Estimate* estimate) {
  const ProblemSubset part(rows_, component);
  ExcessOptions options;
  options.norm = bound_.norm;
  options.smallest_mu = kRemovalMu;
  for (const int64_t i : component) options.weights.push_back(weights_[i]);
  Estimate own = part.Restrict(*estimate);
  const double level = (1 - kInside) * bound_.max_error;
  const ExcessSolution solution =
      MinimizeExcess(part.problem(), level, options, context_, &own);
  part.Replace(own, estimate);
  const std::vector<double> weights = WeightsAgainst(solution.excess, level);
  for (size_t n = 0; n < component.size(); ++n) {
    if (solution.price[n] > kSmallPrice) is_tight_[component[n]] = 1;
    weights_[component[n]] = weights[n];
  }
}

void RemovalSearch::Offer(const Estimate& estimate) {
  std::vector<int64_t> above = Above(estimate);
  if (above.size() >= best_.observations.size()) return;
  best_.observations = std::move(above);
  best_.estimate = estimate;
}

// Every point with observations removed tries to take back that which is
// nearest to the bound. Whether one did.
bool RemovalSearch::TakeBack() {
  std::vector<char> is_removed(rows_.observations.size(), 0);
  for (const int64_t i : best_.observations) is_removed[i] = 1;
  std::vector<int64_t> asked;  // one per point, -1: none
  std::vector<int64_t> observations;
  for (int32_t k = 0; k < rows_.num_points; ++k) {
    int64_t nearest = -1;
    double error = 0;
    for (int64_t i = rows_.point_begin[k]; i < rows_.point_begin[k + 1]; ++i) {
      if (!is_removed[i]) continue;
      const double own = Error(best_.estimate, i);
      if (!std::isfinite(own) || (nearest >= 0 && own >= error)) continue;
      nearest = i;
      error = own;
    }
    if (nearest < 0) continue;
    asked.push_back(nearest);
    for (int64_t i = rows_.point_begin[k]; i < rows_.point_begin[k + 1]; ++i) {
      if (!is_removed[i] || i == nearest) observations.push_back(i);
    }
  }
  if (asked.empty()) return false;
  reprojection_.TakeRows(best_.estimate, context_.num_threads, &rows_);
  const ProblemSubset part(rows_, observations);
  Estimate own = part.Restrict(best_.estimate);
  BlockSweep(part.problem(), FastDescentOptions(), bound_.norm, context_)
      .IntersectPoints(&own);
  Estimate moved = best_.estimate;
  part.Replace(own, &moved);
  std::vector<char> is_back(rows_.observations.size(), 0);
  for (const int64_t i : asked) {
    const int32_t k = rows_.observations[i].point;
    bool fits = true;
    for (int64_t j = rows_.point_begin[k]; j < rows_.point_begin[k + 1]; ++j) {
      if (is_removed[j] && j != i) continue;
      fits = fits && Error(moved, j) <= bound_.max_error;
    }
    if (!fits) continue;
    best_.estimate.points[k] = moved.points[k];
    is_back[i] = 1;
  }
  const size_t before = best_.observations.size();
  best_.observations.erase(
      std::remove_if(best_.observations.begin(), best_.observations.end(),
                     [&](int64_t i) { return is_back[i] != 0; }),
      best_.observations.end());
  return best_.observations.size() < before;
}

Removal RemovalSearch::Run() {
  best_.estimate = built_.start;
  best_.observations = Above(built_.start);
  weights_ = WeightsAtStart();
  is_tight_.assign(rows_.observations.size(), 0);
  Estimate estimate = built_.start;
  const std::vector<std::vector<int64_t>> components =
      SplitIntoComponents(rows_);
  for (int n = 0; n < kMaxReweightings && !context_.IsCancelled(); ++n) {
    if (best_.observations.empty()) break;
    reprojection_.TakeRows(estimate, context_.num_threads, &rows_);
    for (const std::vector<int64_t>& component : components) {
      Excess(component, &estimate);
    }
    const size_t before = best_.observations.size();
    Offer(estimate);
    if (n > 0 && best_.observations.size() >= before) break;
  }
  while (!context_.IsCancelled() && TakeBack()) {
  }
  for (size_t i = 0; i < is_tight_.size(); ++i) {
    if (is_tight_[i]) best_.tight.push_back(static_cast<int64_t>(i));
  }
  return std::move(best_);
}

}  // namespace

Removal FindRemoval(const Model& model, const BuiltProblem& built,
                    const ErrorBound& bound, const Context& context) {
  return RemovalSearch(model, built, bound, context).Run();
}

}  // namespace krot
