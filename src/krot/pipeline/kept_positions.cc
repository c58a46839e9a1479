#include "krot/pipeline/kept_positions.h"

#include <algorithm>
#include <utility>

#include "krot/bridge/position_rows.h"
#include "krot/pipeline/pixel_proof.h"

namespace krot::internal {
namespace {

// Of the gap asked for, the level's excess, and how far below the cost proofs
// try it.
constexpr double kShareOfLevel = 0.2;
constexpr double kSharesOfProof[] = {0.3, 0.6, 0.9};
// Errors below it, pixels, are a level that positions can do without.
constexpr double kLeastLevel = 1e-3;

}  // namespace

KeptPositions::KeptPositions(const Model& model,
                             const SolveModelOptions& options,
                             const Context& context,
                             const Reprojection& reprojection,
                             const Estimate& start, BuiltProblem* built)
    : model_(model),
      options_(options),
      context_(context),
      reprojection_(reprojection),
      built_(*built),
      level_(kShareOfLevel * options.joint.relative_gap) {
  if (!Any()) return;
  built_.position_level = std::max(TrueCost(start), kLeastLevel);
  Keep(start);
}

void KeptPositions::Keep(const Estimate& estimate) {
  if (LargestPositionRatio(built_, estimate) > 1 + kKeptInRounds) return;
  const double cost = TrueCost(estimate);
  if (!(cost < cost_)) return;
  estimate_ = estimate;
  cost_ = cost;
}

bool KeptPositions::TakeLevel(const Estimate& estimate, double optimum,
                              double cost) {
  const std::optional<double> level =
      level_.Next(built_.position_level, optimum, cost,
                  LargestPositionRatio(built_, estimate));
  if (level) SetLevel(estimate, *level);
  return level.has_value();
}

void KeptPositions::SetLevel(const Estimate& estimate, double level) const {
  built_.position_level = level;
  TakePositionRows(built_, estimate, &built_.problem);
}

// Bounds above their level are the positions'.
std::optional<PixelCertificate> KeptPositions::Refute(
    const Estimate& estimate, const Certificate& rows,
    std::vector<int64_t> support) const {
  if (!(rows.lower_bound >
        std::max(built_.position_level, options_.init_max_error))) {
    return std::nullopt;
  }
  std::optional<PixelCertificate> proof =
      ProveInPixels(model_, built_, estimate, options_.norm, std::move(support),
                    rows.lower_bound, context_);
  if (!proof || !(proof->lower_bound > options_.init_max_error)) {
    return std::nullopt;
  }
  return proof;
}

std::optional<PixelCertificate> KeptPositions::Prove(
    const Estimate& estimate, const std::vector<int64_t>& support,
    double sufficient) const {
  const double level = built_.position_level;
  const double cost = TrueCost(estimate);
  std::optional<PixelCertificate> proof;
  for (const double share : kSharesOfProof) {
    SetLevel(estimate, (1 - share * options_.joint.relative_gap) * cost);
    proof = ProveInPixels(model_, built_, estimate, options_.norm, support,
                          sufficient, context_);
    if (proof) break;
  }
  SetLevel(estimate, level);
  return proof;
}

}  // namespace krot::internal
