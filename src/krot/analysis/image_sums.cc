#include "krot/analysis/noise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "krot/analysis/pose_rows.h"
#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry/transform.h"
#include "krot/linear/blocks.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix23 = Eigen::Matrix<double, 2, 3>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

// For smaller lambda the density is nearly even, and a series replaces formulas
// that would lose digits.
constexpr double kFlat = 1e-4;

void Add(const PoseRow& row, const Eigen::Matrix2d& R, ImageSums* sums) {
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> of_R;
  of_R.computeDirect(R);
  for (int j = 0; j < 2; ++j) {
    const double r = of_R.eigenvalues()[j];
    if (r < kControlled) continue;
    const Vector2d direction = of_R.eigenvectors().col(j);
    const Vector6 f = row.F.transpose() * direction;
    const double along = direction.dot(row.error);
    sums->M.noalias() += r * f * f.transpose();
    sums->g.noalias() += along * f;
    sums->square += along * along / r;
    ++sums->num_directions;
  }
}

// 1 / sqrt of the smallest eigenvalue of A - B C^-1 B'; infinite if nothing
// holds.
double LargestSpread(const Matrix3d& A, const Matrix3d& B, const Matrix3d& C) {
  const Matrix3d S = A - B * C.ldlt().solve(B.transpose());
  if (!S.allFinite()) return kInfinity;
  const Vector3d values =
      Eigen::SelfAdjointEigenSolver<Matrix3d>(S, Eigen::EigenvaluesOnly)
          .eigenvalues();
  const bool is_held = values[0] > kNoDirection * A.trace();
  return is_held ? 1 / std::sqrt(values[0]) : kInfinity;
}

}  // namespace

double ImageSums::CenterSpread() const {
  return LargestSpread(M.bottomRightCorner<3, 3>(), M.bottomLeftCorner<3, 3>(),
                       M.topLeftCorner<3, 3>());
}

double ImageSums::TurnSpread() const {
  return LargestSpread(M.topLeftCorner<3, 3>(), M.topRightCorner<3, 3>(),
                       M.bottomRightCorner<3, 3>());
}

namespace {

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

double ImageSums::GainExponent(double sigma_px) const {
  return internal::GainExponent(Gain(), square, num_directions, 6, sigma_px);
}

double SuccessExponent(int64_t num_successes, int64_t num_trials, double p) {
  if (num_successes == 0) return 0;
  const auto num = static_cast<double>(num_trials);
  const double s = static_cast<double>(num_successes) / num;
  if (s <= p) return 0;
  const double failures = s < 1 ? (1 - s) * std::log((1 - s) / (1 - p)) : 0;
  return num * (s * std::log(s / p) + failures);
}

std::vector<ImageSums> AddUpImages(const Model& model,
                                   const ModelNoise& noise) {
  const PoseRows all(model, noise);
  std::vector<ImageSums> sums(model.images.size());
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const std::vector<PoseRow> rows = all.Of(k);
    Matrix3d H = Matrix3d::Zero();
    for (const PoseRow& row : rows) {
      H.noalias() += row.F.rightCols<3>().transpose() * row.F.rightCols<3>();
    }
    const Matrix3d root = RootOfInverse(H);
    for (const PoseRow& row : rows) {
      const Matrix23 B = row.F.rightCols<3>() * root;
      const Eigen::Matrix2d R = Eigen::Matrix2d::Identity() - B * B.transpose();
      Add(row, R, &sums[row.image]);
    }
  }
  for (ImageSums& of_image : sums) {
    of_image.step = DeterminedStep(of_image.M, of_image.g);
  }
  return sums;
}

}  // namespace krot::internal
