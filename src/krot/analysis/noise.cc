#include "krot/analysis/noise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include <Eigen/Eigenvalues>

#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"

namespace krot::internal {
namespace {

// A quantile of chi^2 with one and two degrees of freedom.
struct Chi2Quantile {
  double probability;
  double of_chi2[3];  // by degrees of freedom
};
constexpr Chi2Quantile kMedian = {0.5,
                                  {0, 0.4549364231195724, 1.3862943611198906}};
constexpr Chi2Quantile kUpperQuartile = {
    0.75, {0, 1.3233036969314664, 2.772588722239781}};
constexpr Chi2Quantile kLowestDecile = {
    0.1, {0, 0.015790774093431218, 0.21072103131565267}};

void CheckOptions(const Model& model, const NoiseOptions& options) {
  CheckArgument(options.false_alarm > 0 && options.false_alarm < 1,
                "false_alarm", options.false_alarm, "in (0, 1)");
  CheckArgument(options.is_left_out.empty() ||
                    options.is_left_out.size() == model.track_elements.size(),
                "is_left_out.size()", options.is_left_out.size(),
                "the number of track elements, or 0");
  CheckArgument(!options.sigma_px || *options.sigma_px > 0, "sigma_px",
                options.sigma_px.value_or(0), "> 0");
  if (options.relative_sigmas.empty()) return;
  CheckArgument(options.relative_sigmas.size() == model.track_elements.size(),
                "relative_sigmas.size()", options.relative_sigmas.size(),
                "the number of track elements, or 0");
  for (size_t e = 0; e < options.relative_sigmas.size(); ++e) {
    const double sigma = options.relative_sigmas[e];
    CheckArgument(std::isfinite(sigma) && sigma > 0,
                  "relative_sigmas[" + std::to_string(e) + "]", sigma,
                  "a number > 0");
  }
}

// A quantile; between two ranks the lower one. Requires values; changes their
// order.
double Quantile(double share, std::vector<double>* values) {
  const auto rank = static_cast<std::ptrdiff_t>(
      share * static_cast<double>(values->size() - 1));
  std::nth_element(values->begin(), values->begin() + rank, values->end());
  return (*values)[rank];
}

// The scale of a Cauchy loss, over sigma, given the ratio of the 90 % quantile
// of w^2 to its median: a Student's t of two variables and nu degrees of
// freedom has P(w^2 > x) = (1 + x / c^2)^(-nu / 2), and its maximum likelihood
// is this loss with scale c [Lange, Little, Taylor 1989]. With a = 2^(2 / nu):
// the median is c^2 (a - 1), the quantile c^2 (a^log2(10) - 1).
std::optional<double> TailScale(double ratio) {
  if (!(ratio > std::log2(10.0) && std::isfinite(ratio))) return std::nullopt;
  const auto ratio_of = [](double log_a) {
    return std::expm1(log_a * std::log2(10.0)) / std::expm1(log_a);
  };
  double low = 0, high = 1;
  while (ratio_of(high) < ratio) high *= 2;
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (ratio_of(middle) < ratio ? low : high) = middle;
  }
  return std::sqrt(kMedian.of_chi2[2] / std::expm1(high));
}

// Keypoints are stored in single precision: no model has less noise than that.
double SmallestSigma(const Model& model) {
  uint64_t size = 0;
  for (const Camera& camera : model.cameras) {
    size = std::max({size, camera.width, camera.height});
  }
  return static_cast<double>(size) * std::numeric_limits<float>::epsilon();
}

class Snooper {
 public:
  // Measures sigma by this quantile if the options give none.
  Snooper(const Model& model, const NoiseOptions& options,
          const Context& context, const Chi2Quantile& quantile = kMedian)
      : model_(model),
        options_(options),
        context_(context),
        quantile_(quantile),
        tracks_(model, options.relative_sigmas) {
    for (size_t e = 0; e < options.is_left_out.size(); ++e) {
      if (options.is_left_out[e]) tracks_.Remove(e);
    }
    Fit(NumbersUpTo<int64_t>(static_cast<int64_t>(model.points3D.size())));
    Measure();
  }

  const ModelNoise& noise() const { return noise_; }
  NoiseSnooping Snoop();
  ModelNoise TakeNoise();

 private:
  const ObservationNoise& Of(uint64_t e) const {
    return tracks_.observations()[e];
  }
  bool IsTested(uint64_t e) const {
    return tracks_.TakesPart(e) && Of(e).num_controlled > 0;
  }
  double StandardizedErrorOf(uint64_t e) const {
    return StandardizedError(
        tracks_.SquaredError(e) / (*noise_.sigma_px * *noise_.sigma_px),
        Of(e).num_controlled);
  }
  void Fit(const std::vector<int64_t>& points);
  // Sets sigma, each w, and how many are above the critical value.
  void Measure();
  std::vector<SnoopedObservation> RemoveWorst(const Point3D& point) const;

  const Model& model_;
  const NoiseOptions& options_;
  const Context& context_;
  const Chi2Quantile& quantile_;
  TrackNoise tracks_;
  ModelNoise noise_;
};

void Snooper::Fit(const std::vector<int64_t>& points) {
  ParallelForEach(static_cast<int64_t>(points.size()), context_.num_threads,
                  [&](int64_t n) { tracks_.Fit(points[n]); });
}

void Snooper::Measure() {
  std::vector<double> variances;
  double redundancy = 0;
  for (uint64_t e = 0; e < model_.track_elements.size(); ++e) {
    if (!IsTested(e)) continue;
    variances.push_back(tracks_.SquaredError(e) /
                        quantile_.of_chi2[Of(e).num_controlled]);
    redundancy += Of(e).redundancy[0] + Of(e).redundancy[1];
  }
  noise_ = {};
  noise_.num_tested = static_cast<int64_t>(variances.size());
  if (variances.empty()) return;
  const double p = quantile_.probability;
  noise_.sigma_px = options_.sigma_px.value_or(
      std::max(std::sqrt(Quantile(p, &variances)), SmallestSigma(model_)));
  // The quantile of n exponential variables has the variance of a mean of n
  // log(1 - p)^2 (1 - p) / p.
  noise_.degrees_of_freedom =
      std::pow(std::log(1 - p), 2) * (1 - p) / p * redundancy;
  noise_.critical_w =
      CriticalW(noise_.num_tested, options_.false_alarm,
                options_.sigma_px ? kInfinity : noise_.degrees_of_freedom);
  for (uint64_t e = 0; e < model_.track_elements.size(); ++e) {
    if (IsTested(e)) tracks_.SetW(e, StandardizedErrorOf(e));
    noise_.num_above += Of(e).w > noise_.critical_w;
  }
}

std::vector<SnoopedObservation> Snooper::RemoveWorst(
    const Point3D& point) const {
  std::vector<SnoopedObservation> seen, not_seen;
  for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
    if (!tracks_.TakesPart(e)) continue;
    (std::isinf(Of(e).w) ? not_seen : seen).push_back({e, Of(e).w, 0, false});
  }
  SnoopedObservation worst;
  for (const SnoopedObservation& one : seen) {
    if (one.w > worst.w) worst = one;
  }
  // The seen ones decide where the point is; only then does it matter who sees
  // it.
  if (!(worst.w > noise_.critical_w)) return not_seen;
  if (seen.size() > 2) return {worst};
  for (SnoopedObservation& one : seen) {
    one.is_of_two = true;
    one.w = worst.w;  // the other one may be uncontrolled
  }
  return seen;
}

NoiseSnooping Snooper::Snoop() {
  NoiseSnooping result;
  while (noise_.sigma_px) {
    result.sigma_path_px.push_back(*noise_.sigma_px);
    std::vector<int64_t> changed;
    for (size_t k = 0; k < model_.points3D.size(); ++k) {
      for (const SnoopedObservation& one : RemoveWorst(model_.points3D[k])) {
        tracks_.Remove(one.element);
        result.removed.push_back(one);
        if (changed.empty() || changed.back() != static_cast<int64_t>(k)) {
          changed.push_back(static_cast<int64_t>(k));
        }
      }
    }
    if (changed.empty()) break;
    Fit(changed);
    Measure();
  }
  std::vector<SnoopedObservation>& removed = result.removed;
  for (SnoopedObservation& one : removed) {
    one.error_px = tracks_.ErrorOf(one.element).norm();
  }
  SortLargestFirst(&removed, &SnoopedObservation::w);
  result.noise = TakeNoise();
  return result;
}

ModelNoise Snooper::TakeNoise() {
  std::vector<double> squares;
  for (uint64_t e = 0; e < model_.track_elements.size(); ++e) {
    if (IsTested(e)) squares.push_back(Of(e).w * Of(e).w);
  }
  if (!squares.empty()) {
    const double median = Quantile(0.5, &squares);
    const auto scale = TailScale(Quantile(0.9, &squares) / median);
    if (scale) noise_.cauchy_scale_px = *scale * *noise_.sigma_px;
  }
  for (size_t k = 0; k < model_.points3D.size(); ++k) {
    noise_.points.push_back(tracks_.Point(static_cast<int64_t>(k)));
  }
  noise_.observations = tracks_.observations();
  return std::move(noise_);
}

}  // namespace

double CriticalW(int64_t num_tested, double false_alarm,
                 double degrees_of_freedom) {
  const double log_odds =
      std::log(static_cast<double>(num_tested) / false_alarm);
  if (std::isinf(degrees_of_freedom)) return std::sqrt(2 * log_odds);
  return std::sqrt(degrees_of_freedom *
                   std::expm1(2 / degrees_of_freedom * log_odds));
}

Eigen::Matrix3d RootOfInverse(const Eigen::Matrix3d& H) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> of_H(H);
  Eigen::Matrix3d root = of_H.eigenvectors();
  for (int j = 0; j < 3; ++j) {
    const double value = of_H.eigenvalues()[j];
    root.col(j) *=
        value > kNoDirection * of_H.eigenvalues()[2] ? 1 / std::sqrt(value) : 0;
  }
  return root;
}

// P(chi^2 > x) is erfc(sqrt(x / 2)) for one direction, exp(-x / 2) for two.
double StandardizedError(double chi2, int num_directions) {
  if (num_directions == 2) return std::sqrt(chi2);
  if (num_directions == 0) return kNaN;
  const double probability = std::erfc(std::sqrt(chi2 / 2));
  if (probability > 1e-300) return std::sqrt(-2 * std::log(probability));
  // erfc(x) ~ exp(-x^2) / (x sqrt(pi))
  return std::sqrt(chi2 + std::log(chi2 * std::acos(-1.0) / 2));
}

NoiseSnooping SnoopNoise(const Model& model, const NoiseOptions& options,
                         const Context& context, bool may_be_bent) {
  CheckOptions(model, options);
  Snooper by_median(model, options, context);
  const int64_t half = by_median.noise().num_tested / 2;
  const auto is_most_left = [&](const NoiseSnooping& one) {
    return static_cast<int64_t>(one.removed.size()) <= half;
  };
  NoiseSnooping result = by_median.Snoop();
  if (may_be_bent && result.noise.sigma_px.value_or(0) > kFilteredPx) {
    // Either the model is not adjusted, or images that are far off bend most
    // tracks. Then what the other tracks are within agrees with most of the
    // rest.
    NoiseSnooping least =
        Snooper(model, options, context, kLowestDecile).Snoop();
    if (is_most_left(least) &&
        *least.noise.sigma_px < *result.noise.sigma_px / 4) {
      return least;
    }
  }
  if (is_most_left(result)) return result;
  // Then sigma has followed the removals down, as the median does where errors
  // have no common size. A higher quantile follows less, and finds nothing more
  // in what is left. If it does, too, sigma stays as it was at first.
  Snooper snooper(model, options, context, kUpperQuartile);
  NoiseOptions held = options;
  held.sigma_px = snooper.noise().sigma_px;
  result = snooper.Snoop();
  if (!is_most_left(result)) result = Snooper(model, held, context).Snoop();
  result.has_common_noise = false;
  return result;
}

// P(chi^2 > 2 x) = exp(-x) sum x^i / i!, and for Beta(j, m) P(> s) =
// (1 - s)^m sum (m + i - 1 over i) s^i, with j terms each.
double GainExponent(double gain, double square, int64_t num_directions,
                    int num_parameters, double sigma_px) {
  const double num_terms = (num_parameters + 1) / 2;
  const double m = static_cast<double>(num_directions) / 2 - num_terms;
  if (!(m > 0) || !(gain > 0)) return 0;
  const double x = gain / (2 * sigma_px * sigma_px);
  const double share = std::min(gain / square, 1 - 1e-12);
  double by_model = 1, model_term = 1, by_own = 1, own_term = 1;
  for (double i = 1; i < num_terms; ++i) {
    by_model += model_term *= x / i;
    by_own += own_term *= (m + i - 1) / i * share;
  }
  return std::min(x - std::log(by_model),
                  -m * std::log1p(-share) - std::log(by_own));
}

double SuccessExponent(int64_t num_successes, int64_t num_trials, double p) {
  if (num_successes == 0) return 0;
  const auto num = static_cast<double>(num_trials);
  const double s = static_cast<double>(num_successes) / num;
  if (s <= p) return 0;
  const double failures = s < 1 ? (1 - s) * std::log((1 - s) / (1 - p)) : 0;
  return num * (s * std::log(s / p) + failures);
}

}  // namespace krot::internal

namespace krot {

using namespace internal;

ModelNoise EstimateNoise(const Model& model, const NoiseOptions& options,
                         const Context& context) {
  CheckOptions(model, options);
  return Snooper(model, options, context).TakeNoise();
}

}  // namespace krot
