#include "krot/report/html_error_curves.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace krot::internal {
namespace {

size_t HistogramBin(double error_px) {
  const double bin =
      std::floor((std::log10(error_px) - ErrorHistogram::kMinExponent) *
                 ErrorHistogram::kBinsPerDecade);
  return bin > 0 ? static_cast<size_t>(bin) : 0;  // log10(0) = -infinity
}

int64_t NextRank(int64_t rank) {
  constexpr double kStep = 1.05;
  return std::max(rank + 1,
                  static_cast<int64_t>(kStep * static_cast<double>(rank)));
}

}  // namespace

ErrorHistogram ComputeErrorHistogram(const std::vector<double>& errors_px) {
  ErrorHistogram histogram;
  for (const double error_px : errors_px) {
    if (!std::isfinite(error_px)) continue;
    const size_t bin = HistogramBin(error_px);
    if (bin >= histogram.counts.size()) histogram.counts.resize(bin + 1);
    ++histogram.counts[bin];
  }
  return histogram;
}

std::vector<std::pair<int64_t, double>> ErrorTail(
    std::vector<double> errors_px) {
  errors_px.erase(
      std::remove_if(errors_px.begin(), errors_px.end(),
                     [](double error) { return !std::isfinite(error); }),
      errors_px.end());
  std::sort(errors_px.begin(), errors_px.end(), std::greater<>());
  const auto num_errors = static_cast<int64_t>(errors_px.size());
  std::vector<std::pair<int64_t, double>> tail;
  for (int64_t rank = 1; rank < num_errors; rank = NextRank(rank)) {
    tail.emplace_back(rank, errors_px[rank - 1]);
  }
  if (num_errors > 0) tail.emplace_back(num_errors, errors_px.back());
  return tail;
}

}  // namespace krot::internal
