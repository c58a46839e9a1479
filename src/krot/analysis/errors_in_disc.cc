#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "krot/analysis/noise.h"
#include "krot/base/numbers.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

// For smaller lambda the density is nearly even, and a series replaces formulas
// that would lose digits.
constexpr double kFlat = 1e-4;

// The mean of the density lambda exp(-lambda u) / (1 - exp(-lambda)) on [0, 1].
double MeanInDisc(double lambda) {
  return lambda < kFlat ? 0.5 - lambda / 12
                        : 1 / lambda - 1 / std::expm1(lambda);
}

// log(lambda / (1 - exp(-lambda))).
double LogFactorInDisc(double lambda) {
  return lambda < kFlat ? lambda / 2 : std::log(lambda / -std::expm1(-lambda));
}

// The same for the density f exp(-lambda u) / (2 sqrt(u)), whose factor is f.
double LogFactorOnSegment(double lambda) {
  if (lambda < kFlat) return lambda / 3;
  const double root = std::sqrt(lambda);
  return std::log(2 * root / (std::sqrt(kPi) * std::erf(root)));
}

double MeanOnSegment(double lambda) {
  if (lambda < kFlat) return 1.0 / 3 - 4.0 / 45 * lambda;
  return (1 - std::exp(LogFactorOnSegment(lambda) - lambda)) / (2 * lambda);
}

}  // namespace

ErrorsInDisc::ErrorsInDisc(const std::vector<double>& errors_px,
                           const std::vector<double>& errors_of_two_px,
                           double limit_px) {
  const auto add = [&](const std::vector<double>& errors, double weight,
                       int64_t* count) {
    for (const double error : errors) {
      if (!(error <= limit_px) || limit_px == 0) continue;
      ++*count;
      mean_ += weight * error * error / (limit_px * limit_px);
    }
  };
  add(errors_px, 1, &num_in_disc_);
  add(errors_of_two_px, 2, &num_on_segment_);
  if (num() == 0) return;
  mean_ = std::min(MeanAt(0), mean_ / static_cast<double>(num()));
  if (mean_ == MeanAt(0)) return;
  double low = 0;
  double high = 1 / std::max(mean_, std::numeric_limits<double>::min());
  for (double middle = high / 2; low < middle && middle < high;
       middle = low + (high - low) / 2) {
    (MeanAt(middle) > mean_ ? low : high) = middle;
  }
  lambda_ = low;
}

double ErrorsInDisc::MeanAt(double lambda) const {
  return (static_cast<double>(num_in_disc_) * MeanInDisc(lambda) +
          2 * static_cast<double>(num_on_segment_) *
              MeanOnSegment(2 * lambda)) /
         static_cast<double>(num());
}

double ErrorsInDisc::LogFactors(double lambda) const {
  return static_cast<double>(num_in_disc_) * LogFactorInDisc(lambda) +
         static_cast<double>(num_on_segment_) * LogFactorOnSegment(2 * lambda);
}

double ErrorsInDisc::Exponent(double other) const {
  return LogFactors(lambda_) - LogFactors(other) +
         (other - lambda_) * mean_ * static_cast<double>(num());
}

std::vector<ErrorsInDisc> FillDiscs(const Model& model,
                                    const std::vector<double>& errors_px) {
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::vector<std::vector<double>> of_two(model.images.size());
  std::vector<std::vector<double>> of_more(model.images.size());
  std::vector<double> all;
  for (const Point3D& point : model.points3D) {
    auto& of_image =
        point.track_end - point.track_begin == 2 ? of_two : of_more;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!std::isfinite(errors_px[e])) continue;
      of_image[image_of[e]].push_back(errors_px[e]);
      all.push_back(errors_px[e]);
    }
  }
  double limit = 0;
  if (!all.empty()) {
    const auto rank = all.begin() + (999 * all.size() - 1) / 1000;
    std::nth_element(all.begin(), rank, all.end());
    limit = *rank;
  }
  std::vector<ErrorsInDisc> discs;
  for (size_t n = 0; n < model.images.size(); ++n) {
    discs.emplace_back(of_more[n], of_two[n], limit);
  }
  return discs;
}

}  // namespace krot::internal
