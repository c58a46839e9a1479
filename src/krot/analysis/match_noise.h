#pragma once

#include <vector>

namespace krot::internal {

struct MatchNoise {
  double sigma_px = 0;      // per axis and keypoint
  double tolerance_px = 0;  // no Gaussian error of all exceeds it, 95 %
};

// From the errors of each pair of images (Sampson's distances, pixels), each
// list ascending; empty lists do not count. A match of a sound model lies
// within the tolerance, however many there are: of N Gaussian errors the
// largest exceeds sigma sqrt(2 ln(N / alpha)) with a probability below
// alpha = 0.05. Sigma is that of the pairs whose median error is at most twice
// that of the best quarter: so a few wrong poses do not hide among the noise,
// as long as half of the images are right. Zeros without errors.
MatchNoise EstimateMatchNoise(
    const std::vector<std::vector<double>>& errors_px);

}  // namespace krot::internal
