#pragma once

#include <vector>

namespace krot {

// Weights for the next excess programme [Candes, Wakin, Boyd 2008]: an excess
// much below a tenth of `bound` costs ten times as much as one of the bound.
inline std::vector<double> WeightsAgainst(const std::vector<double>& excess,
                                          double bound) {
  constexpr double kDearExcess = 0.1;
  std::vector<double> weights;
  weights.reserve(excess.size());
  for (const double own : excess) {
    weights.push_back(kDearExcess / (kDearExcess + own / bound));
  }
  return weights;
}

}  // namespace krot
