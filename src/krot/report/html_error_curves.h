#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace krot::internal {

// The distribution of a model's errors, small enough for a page at any number
// of observations. Errors that are not finite do not count.

struct ErrorHistogram {
  static constexpr int kMinExponent = -3;  // of the first bin's lower end
  static constexpr int kBinsPerDecade = 10;
  // Bin k ends at 10^(kMinExponent + (k + 1) / kBinsPerDecade) pixels. The
  // first also holds smaller errors; the last is not empty.
  std::vector<int64_t> counts;
};
// Requires errors >= 0 where finite. O(count).
ErrorHistogram ComputeErrorHistogram(const std::vector<double>& errors_px);

// (rank, error), the largest error being of rank 1, the smallest last; ranks
// follow each other by at most 5 %, or by 1. O(count log count).
std::vector<std::pair<int64_t, double>> ErrorTail(
    std::vector<double> errors_px);

}  // namespace krot::internal
