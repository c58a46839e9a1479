#include "krot/analysis/match_noise.h"

#include <algorithm>
#include <cmath>

namespace krot::internal {

MatchNoise EstimateMatchNoise(
    const std::vector<std::vector<double>>& errors_px) {
  constexpr double kAlpha = 0.05;
  constexpr double kLeastSigmaPx = 1e-3;       // keypoints are 32-bit floats
  constexpr double kMedianOverSigma = 0.6745;  // of |x|, Gaussian
  const auto median_of = [](const std::vector<double>& errors) {
    return errors[errors.size() / 2];
  };
  std::vector<double> medians;
  size_t num_matches = 0;
  for (const std::vector<double>& errors : errors_px) {
    if (errors.empty()) continue;
    medians.push_back(median_of(errors));
    num_matches += errors.size();
  }
  if (medians.empty()) return {};
  std::sort(medians.begin(), medians.end());
  const double largest_median = 2 * medians[medians.size() / 4];
  std::vector<double> better;
  for (const std::vector<double>& errors : errors_px) {
    if (errors.empty() || median_of(errors) > largest_median) continue;
    better.insert(better.end(), errors.begin(), errors.end());
  }
  std::nth_element(better.begin(), better.begin() + better.size() / 2,
                   better.end());
  MatchNoise noise;
  noise.sigma_px =
      std::max(median_of(better) / kMedianOverSigma, kLeastSigmaPx);
  noise.tolerance_px =
      noise.sigma_px *
      std::sqrt(2 * std::log(static_cast<double>(num_matches) / kAlpha));
  return noise;
}

}  // namespace krot::internal
