#include "krot/solver/verified_blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Real = long double;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;
using Block = Eigen::Matrix<double, 3, 2>;
using Columns = UncertainSystem::Columns;

constexpr double kUnitRoundoff = std::numeric_limits<double>::epsilon() / 2;
constexpr Real kRealRoundoff = std::numeric_limits<Real>::epsilon();
// Covers the roundings of sums and products of non-negative bounds.
constexpr double kOutward = 1 + 1e-9;
// Twice what the theory asks for: factorisations may multiply by reciprocals.
constexpr double kSafety = 2;
// The c that are tried.
constexpr double kLargestShift = 1e-1;
constexpr double kSmallestShift = 1e-13;
constexpr double kShiftRatio = 1e-1;

// The columns of T M in double precision, as they are used from here on.
struct ScaledColumns {
  int32_t point;
  int32_t frame;
  Block point_rows;
  Block frame_rows;
};

bool IsInvertible(const Matrix3& T) {
  // Lower triangular.
  return T.allFinite() && T(0, 0) != 0 && T(1, 1) != 0 && T(2, 2) != 0;
}

// T with T G T' = I up to rounding, for G = L L': L^-1; not finite if there is
// none.
Matrix3 Whiten(const Matrix3& gram) {
  const Eigen::LLT<Matrix3> llt(gram);
  if (llt.info() != Eigen::Success) {
    return Matrix3::Constant(std::numeric_limits<Real>::quiet_NaN());
  }
  return llt.matrixL().solve(Matrix3::Identity());
}

class Verifier {
 public:
  explicit Verifier(const UncertainSystem& system)
      : system_(system),
        num_points_(system.point_bound.size()),
        num_frames_(system.frame_bound.size()) {}

  std::optional<double> Run();

 private:
  bool FindScaling();
  bool Scale();
  void FormFrames();
  bool IsAbove(double shift) const;
  double RoundingOfH() const;
  double LengthOfG() const;

  // Calls visit(begin, end) for the columns of every point.
  template <typename Visit>
  bool ForPoints(const Visit& visit) const;

  const UncertainSystem& system_;
  const size_t num_points_;
  const size_t num_frames_;
  std::vector<Matrix3> T_point_;
  std::vector<Matrix3> T_frame_;
  std::vector<ScaledColumns> columns_;
  double matrix_error_ = 0;  // Frobenius norm of what T M is not known by
  MatrixXd frames_;          // the frames' part of H, lower triangle
};

template <typename Visit>
bool Verifier::ForPoints(const Visit& visit) const {
  const auto& columns = system_.columns;
  std::vector<char> is_seen(num_points_, 0);
  for (size_t begin = 0; begin < columns.size();) {
    size_t end = begin;
    while (end < columns.size() && columns[end].point == columns[begin].point) {
      ++end;
    }
    is_seen[columns[begin].point] = 1;
    if (!visit(begin, end)) return false;
    begin = end;
  }
  return std::find(is_seen.begin(), is_seen.end(), 0) == is_seen.end();
}

// By a point's Gram matrix first, and by what is left of a frame's once the
// points are eliminated.
bool Verifier::FindScaling() {
  T_point_.resize(num_points_);
  T_frame_.resize(num_frames_);
  std::vector<Matrix3> left(num_frames_, Matrix3::Zero());
  const bool has_points = ForPoints([&](size_t begin, size_t end) {
    const Columns* columns = system_.columns.data();
    Matrix3 gram = Matrix3::Zero();
    for (size_t i = begin; i < end; ++i) {
      gram += columns[i].point_rows * columns[i].point_rows.transpose();
    }
    // Twice: what one pass leaves of a badly scaled matrix is well scaled.
    Matrix3& T = T_point_[columns[begin].point];
    T = Whiten(gram);
    gram.setZero();
    for (size_t i = begin; i < end; ++i) {
      const UncertainSystem::Block P = T * columns[i].point_rows;
      gram += P * P.transpose();
    }
    T = Whiten(gram) * T;
    if (!IsInvertible(T)) return false;
    for (size_t i = begin; i < end; ++i) {
      const Columns& c = columns[i];
      if (c.frame < 0) continue;
      const Matrix3 G = (T * c.point_rows) * c.frame_rows.transpose();
      left[c.frame] +=
          c.frame_rows * c.frame_rows.transpose() - G.transpose() * G;
    }
    return true;
  });
  if (!has_points) return false;
  for (size_t f = 0; f < num_frames_; ++f) {
    T_frame_[f] = Whiten(left[f]);
    if (!IsInvertible(T_frame_[f])) return false;
  }
  return true;
}

// Rounds T M to doubles and sums up what that and the system's own uncertainty
// amount to.
bool Verifier::Scale() {
  Real sum = 0;
  const auto scale = [&](const Matrix3& T, const UncertainSystem::Block& rows,
                         const UncertainSystem::BlockError& error) {
    const UncertainSystem::Block exact = T * rows;
    const UncertainSystem::Block terms =
        T.cwiseAbs() *
        (rows.cwiseAbs() * (8 * kRealRoundoff) + error.cast<Real>());
    sum += (terms + exact.cwiseAbs() * Real{kUnitRoundoff}).squaredNorm();
    return Block(exact.cast<double>());
  };
  columns_.reserve(system_.columns.size());
  for (const Columns& c : system_.columns) {
    ScaledColumns scaled{c.point, c.frame, Block::Zero(), Block::Zero()};
    scaled.point_rows = scale(T_point_[c.point], c.point_rows, c.point_error);
    if (c.frame >= 0) {
      scaled.frame_rows = scale(T_frame_[c.frame], c.frame_rows, c.frame_error);
    }
    columns_.push_back(scaled);
  }
  matrix_error_ = static_cast<double>(std::sqrt(sum)) * kOutward;
  return std::isfinite(matrix_error_);
}

void Verifier::FormFrames() {
  const int64_t size = 3 * static_cast<int64_t>(num_frames_);
  frames_ = MatrixXd::Zero(size, size);
  for (const ScaledColumns& c : columns_) {
    if (c.frame < 0) continue;
    frames_.block<3, 3>(3 * c.frame, 3 * c.frame) +=
        c.frame_rows * c.frame_rows.transpose();
  }
}

// How far, at most, lambda_min of the exact H is below a shift whose
// factorisation runs to its end: the rounding of H, and of the factorisation.
// An entry of H is a sum of n products, |error| <= (n + 2) u |T M| |T M|', and
// | |T M| |T M|' |_2 is at most the largest column sum times the largest row
// sum. A row of the factor with n entries adds (n + 2) u times its diagonal
// entry of H.
double Verifier::RoundingOfH() const {
  std::vector<Vector3d> point_sum(num_points_, Vector3d::Zero());
  std::vector<Vector3d> frame_sum(num_frames_, Vector3d::Zero());
  std::vector<Vector3d> point_diagonal(num_points_, Vector3d::Zero());
  std::vector<Vector3d> frame_diagonal(num_frames_, Vector3d::Zero());
  std::vector<double> point_count(num_points_, 0);
  std::vector<double> frame_count(num_frames_, 0);
  double column_sum = 0;
  for (const ScaledColumns& c : columns_) {
    point_sum[c.point] += c.point_rows.cwiseAbs().rowwise().sum();
    point_diagonal[c.point] += c.point_rows.rowwise().squaredNorm();
    point_count[c.point] += 2;
    Eigen::RowVector2d sum = c.point_rows.cwiseAbs().colwise().sum();
    if (c.frame >= 0) {
      frame_sum[c.frame] += c.frame_rows.cwiseAbs().rowwise().sum();
      frame_diagonal[c.frame] += c.frame_rows.rowwise().squaredNorm();
      frame_count[c.frame] += 2;
      sum += c.frame_rows.cwiseAbs().colwise().sum();
    }
    column_sum = std::max(column_sum, sum.maxCoeff());
  }
  double row_sum = 0;
  double count = 0;
  double factor = 0;
  for (size_t k = 0; k < num_points_; ++k) {
    row_sum = std::max(row_sum, point_sum[k].maxCoeff());
    count = std::max(count, point_count[k]);
    factor += (3 + 2) * point_diagonal[k].sum();
  }
  for (size_t f = 0; f < num_frames_; ++f) {
    row_sum = std::max(row_sum, frame_sum[f].maxCoeff());
    count = std::max(count, frame_count[f]);
    // A point, seen twice or once, has three entries in a frame's row.
    factor +=
        (1.5 * frame_count[f] + 3 * static_cast<double>(num_frames_) + 2) *
        frame_diagonal[f].sum();
  }
  return kSafety * kUnitRoundoff *
         ((count + 2) * column_sum * row_sum + factor) * kOutward;
}

// Whether H - shift I has a Cholesky factor, the points' rows first.
bool Verifier::IsAbove(double shift) const {
  MatrixXd left = frames_;
  left.diagonal().array() -= shift;
  const bool has_points = ForPoints([&](size_t begin, size_t end) {
    Matrix3d H = Matrix3d::Zero();
    for (size_t i = begin; i < end; ++i) {
      H += columns_[i].point_rows * columns_[i].point_rows.transpose();
    }
    H.diagonal().array() -= shift;
    const Eigen::LLT<Matrix3d> llt(H);
    if (llt.info() != Eigen::Success) return false;
    // One block per frame: a frame may see the point several times.
    std::vector<std::pair<int32_t, Matrix3d>> blocks;  // L^-1 H_kf
    for (size_t i = begin; i < end; ++i) {
      const ScaledColumns& c = columns_[i];
      if (c.frame < 0) continue;
      const Matrix3d product = c.point_rows * c.frame_rows.transpose();
      const auto same = std::find_if(
          blocks.begin(), blocks.end(),
          [&](const auto& block) { return block.first == c.frame; });
      if (same == blocks.end()) {
        blocks.emplace_back(c.frame, product);
      } else {
        same->second += product;
      }
    }
    for (auto& [frame, block] : blocks) llt.matrixL().solveInPlace(block);
    for (const auto& [f, block_f] : blocks) {
      for (const auto& [g, block_g] : blocks) {
        if (f < g) continue;
        left.block<3, 3>(3 * f, 3 * g).noalias() -=
            block_f.transpose() * block_g;
      }
    }
    return true;
  });
  if (!has_points) return false;
  if (num_frames_ == 0) return true;
  const Eigen::LLT<Eigen::Ref<MatrixXd>> llt(left);
  return llt.info() == Eigen::Success && left.diagonal().allFinite();
}

double Verifier::LengthOfG() const {
  Real sum = 0;
  for (size_t k = 0; k < num_points_; ++k) {
    sum += (T_point_[k].cwiseAbs() * system_.point_bound[k].cast<Real>())
               .squaredNorm();
  }
  for (size_t f = 0; f < num_frames_; ++f) {
    sum += (T_frame_[f].cwiseAbs() * system_.frame_bound[f].cast<Real>())
               .squaredNorm();
  }
  return static_cast<double>(std::sqrt(sum)) * kOutward;
}

std::optional<double> Verifier::Run() {
  if (num_frames_ > static_cast<size_t>(kMaxVerifiedFrames) || !FindScaling() ||
      !Scale()) {
    return std::nullopt;
  }
  FormFrames();
  const double rounding = RoundingOfH();
  for (double shift = kLargestShift; shift >= kSmallestShift;
       shift *= kShiftRatio) {
    const double sigma =
        std::sqrt(std::max(0.0, shift - rounding)) * (1 - 4 * kUnitRoundoff) -
        matrix_error_;
    if (!(sigma > 0)) break;
    if (!IsAbove(shift)) continue;
    const double length = LengthOfG() / sigma * kOutward;
    if (!std::isfinite(length)) break;
    return length;
  }
  return std::nullopt;
}

}  // namespace

std::optional<double> BoundSolutionByBlocks(const UncertainSystem& system) {
  return Verifier(system).Run();
}

}  // namespace krot
