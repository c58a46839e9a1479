#pragma once

#include <vector>

namespace krot::internal {

// Weights for the next slack programme [Candes, Wakin, Boyd 2008]: an excess
// much below the share `dear` of `bound` costs 1 / dear times as much as one of
// the bound.
inline std::vector<double> WeightsAgainst(const std::vector<double>& excess,
                                          double bound, double dear) {
  std::vector<double> weights;
  weights.reserve(excess.size());
  for (const double own : excess) {
    weights.push_back(dear / (dear + own / bound));
  }
  return weights;
}

}  // namespace krot::internal
