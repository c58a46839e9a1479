#include "krot/solver/verified_blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "krot/solver/scaled_system.h"

namespace krot {
namespace {

using Real = long double;
template <typename Scalar>
using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;
template <typename Scalar>
using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
using Vector3 = Eigen::Matrix<Real, 3, 1>;

constexpr Real kUnitRoundoff = std::numeric_limits<Real>::epsilon() / 2;
// Covers the roundings of sums and products of non-negative bounds.
constexpr Real kOutward = 1 + 1e-9L;
// Twice what the theory asks for: factorisations may multiply by reciprocals.
constexpr Real kSafety = 2;
// The c that are tried, as shares of an estimate of lambda_min.
constexpr double kShiftShares[] = {0.3, 0.05, 0.005};
constexpr int kPowerIterations = 20;

class Verifier {
 public:
  explicit Verifier(const ScaledSystem& system)
      : system_(system),
        columns_(system.columns),
        num_points_(system.num_points),
        num_frames_(system.num_frames) {}

  std::optional<double> Run() const;

 private:
  template <typename Scalar>
  bool EliminatePoints(double shift, Matrix<Scalar>* frames) const;
  std::optional<double> EstimateSmallest() const;
  bool IsAbove(double shift) const;
  Real RoundingOfH() const;

  const ScaledSystem& system_;
  const std::vector<ScaledSystem::Columns>& columns_;
  const size_t num_points_;
  const size_t num_frames_;
};

// How far, at most, lambda_min of the exact H is below a shift whose
// factorisation runs to its end: the rounding of H, and of the factorisation.
// An entry of H is a sum of n products, |error| <= (n + 2) u |T M| |T M|', and
// | |T M| |T M|' |_2 is at most the largest column sum times the largest row
// sum. A row of the factor with n entries adds (n + 2) u times its diagonal
// entry of H.
Real Verifier::RoundingOfH() const {
  std::vector<Vector3> point_sum(num_points_, Vector3::Zero());
  std::vector<Vector3> frame_sum(num_frames_, Vector3::Zero());
  std::vector<Vector3> point_diagonal(num_points_, Vector3::Zero());
  std::vector<Vector3> frame_diagonal(num_frames_, Vector3::Zero());
  std::vector<Real> point_count(num_points_, 0);
  std::vector<Real> frame_count(num_frames_, 0);
  Real column_sum = 0;
  for (const ScaledSystem::Columns& c : columns_) {
    point_sum[c.point] += c.point_rows.cwiseAbs().rowwise().sum();
    point_diagonal[c.point] += c.point_rows.rowwise().squaredNorm();
    point_count[c.point] += 2;
    Eigen::Matrix<Real, 1, 2> sum = c.point_rows.cwiseAbs().colwise().sum();
    if (c.frame >= 0) {
      frame_sum[c.frame] += c.frame_rows.cwiseAbs().rowwise().sum();
      frame_diagonal[c.frame] += c.frame_rows.rowwise().squaredNorm();
      frame_count[c.frame] += 2;
      sum += c.frame_rows.cwiseAbs().colwise().sum();
    }
    column_sum = std::max(column_sum, sum.maxCoeff());
  }
  Real row_sum = 0;
  Real count = 0;
  Real factor = 0;
  for (size_t k = 0; k < num_points_; ++k) {
    row_sum = std::max(row_sum, point_sum[k].maxCoeff());
    count = std::max(count, point_count[k]);
    factor += (3 + 2) * point_diagonal[k].sum();
  }
  for (size_t f = 0; f < num_frames_; ++f) {
    row_sum = std::max(row_sum, frame_sum[f].maxCoeff());
    count = std::max(count, frame_count[f]);
    // A point, seen twice or once, has three entries in a frame's row.
    factor += (1.5L * frame_count[f] + 3 * static_cast<Real>(num_frames_) + 2) *
              frame_diagonal[f].sum();
  }
  return kSafety * kUnitRoundoff *
         ((count + 2) * column_sum * row_sum + factor) * kOutward;
}

// The frames' part of H - shift I once the points are eliminated, its lower
// triangle; false if the points' part has no Cholesky factor.
template <typename Scalar>
bool Verifier::EliminatePoints(double shift, Matrix<Scalar>* frames) const {
  const int64_t size = 3 * static_cast<int64_t>(num_frames_);
  frames->setZero(size, size);
  frames->diagonal().array() -= shift;
  return ForPoints(columns_, num_points_, [&](size_t begin, size_t end) {
    Matrix3<Scalar> H = Matrix3<Scalar>::Zero();
    // One block per frame: a frame may see the point several times.
    std::vector<std::pair<int32_t, Matrix3<Scalar>>> blocks;  // L^-1 H_kf
    for (size_t i = begin; i < end; ++i) {
      const ScaledSystem::Columns& c = columns_[i];
      const Eigen::Matrix<Scalar, 3, 2> P = c.point_rows.cast<Scalar>();
      H += P * P.transpose();
      if (c.frame < 0) continue;
      const Eigen::Matrix<Scalar, 3, 2> F = c.frame_rows.cast<Scalar>();
      frames->template block<3, 3>(3 * c.frame, 3 * c.frame) +=
          F * F.transpose();
      const auto same = std::find_if(
          blocks.begin(), blocks.end(),
          [&](const auto& block) { return block.first == c.frame; });
      if (same == blocks.end()) {
        blocks.emplace_back(c.frame, P * F.transpose());
      } else {
        same->second += P * F.transpose();
      }
    }
    H.diagonal().array() -= shift;
    const Eigen::LLT<Matrix3<Scalar>> llt(H);
    if (llt.info() != Eigen::Success) return false;
    for (auto& block : blocks) llt.matrixL().solveInPlace(block.second);
    for (const auto& [f, block_f] : blocks) {
      for (const auto& [g, block_g] : blocks) {
        if (f < g) continue;
        frames->template block<3, 3>(3 * f, 3 * g).noalias() -=
            block_f.transpose() * block_g;
      }
    }
    return true;
  });
}

// About lambda_min of the frames' part, by inverse iteration in double
// precision. None if that says that it is not positive.
std::optional<double> Verifier::EstimateSmallest() const {
  Matrix<double> frames;
  if (!EliminatePoints(0, &frames)) return std::nullopt;
  if (num_frames_ == 0) return 1;
  const Eigen::LLT<Eigen::Ref<Matrix<double>>> llt(frames);
  if (llt.info() != Eigen::Success) return std::nullopt;
  Eigen::VectorXd x(frames.rows());
  for (int64_t i = 0; i < x.size(); ++i) {
    x[i] = 1 + 0.5 * std::sin(static_cast<double>(i));
  }
  double growth = 1;
  for (int n = 0; n < kPowerIterations; ++n) {
    x.normalize();
    llt.solveInPlace(x);
    growth = x.norm();
  }
  return std::min(1.0, 1 / growth);
}

// Whether H - shift I has a Cholesky factor, the points' rows first.
bool Verifier::IsAbove(double shift) const {
  Matrix<Real> frames;
  if (!EliminatePoints(shift, &frames)) return false;
  if (num_frames_ == 0) return true;
  const Eigen::LLT<Eigen::Ref<Matrix<Real>>> llt(frames);
  return llt.info() == Eigen::Success && frames.diagonal().allFinite();
}

std::optional<double> Verifier::Run() const {
  const std::optional<double> smallest = EstimateSmallest();
  if (!smallest) return std::nullopt;
  const Real rounding = RoundingOfH();
  for (const double share : kShiftShares) {
    const double shift = share * *smallest;
    const Real sigma = std::sqrt(std::max(Real{0}, shift - rounding)) *
                           (1 - 4 * kUnitRoundoff) -
                       system_.matrix_error;
    if (!(sigma > 0)) break;
    if (!IsAbove(shift)) continue;
    const Real length = system_.bound_length / sigma * kOutward;
    if (!std::isfinite(length)) break;
    return static_cast<double>(length) * (1 + 1e-15);
  }
  return std::nullopt;
}

}  // namespace

std::optional<double> BoundSolutionByBlocks(const UncertainSystem& system) {
  if (static_cast<int64_t>(system.frame_bound.size()) > kMaxVerifiedFrames) {
    return std::nullopt;
  }
  const std::optional<ScaledSystem> scaled = ScaleBlocks(system);
  return scaled ? Verifier(*scaled).Run() : std::nullopt;
}

}  // namespace krot
