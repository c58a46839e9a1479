#include "krot/solver/scaled_system.h"

#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace krot {
namespace {

using Real = ScaledSystem::Real;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;
using Block = UncertainSystem::Block;
using Columns = UncertainSystem::Columns;

constexpr Real kUnitRoundoff = std::numeric_limits<Real>::epsilon() / 2;
// Covers the roundings of sums and products of non-negative bounds.
constexpr Real kOutward = 1 + 1e-9L;

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

class Scaling {
 public:
  explicit Scaling(const UncertainSystem& system)
      : system_(system),
        num_points_(system.point_bound.size()),
        num_frames_(system.frame_bound.size()) {}

  bool Find();
  ScaledSystem Apply() const;

 private:
  Real BoundLength() const;

  const UncertainSystem& system_;
  const size_t num_points_;
  const size_t num_frames_;
  std::vector<Matrix3> T_point_;
  std::vector<Matrix3> T_frame_;
};

// By a point's Gram matrix first, and by what is left of a frame's once the
// points are eliminated.
bool Scaling::Find() {
  T_point_.resize(num_points_);
  T_frame_.resize(num_frames_);
  std::vector<Matrix3> left(num_frames_, Matrix3::Zero());
  const bool has_points =
      ForPoints(system_.columns, num_points_, [&](size_t begin, size_t end) {
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
          const Block P = T * columns[i].point_rows;
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

// Sums up, too, what its rounding and the system's own uncertainty amount to.
ScaledSystem Scaling::Apply() const {
  ScaledSystem result;
  result.num_points = num_points_;
  result.num_frames = num_frames_;
  Real sum = 0;
  const auto scale = [&](const Matrix3& T, const Block& rows,
                         const UncertainSystem::BlockError& error) -> Block {
    const Block terms = T.cwiseAbs() * (rows.cwiseAbs() * (8 * kUnitRoundoff) +
                                        error.cast<Real>());
    sum += terms.squaredNorm();
    return T * rows;
  };
  result.columns.reserve(system_.columns.size());
  for (const Columns& c : system_.columns) {
    ScaledSystem::Columns scaled{c.point, c.frame, Block::Zero(),
                                 Block::Zero()};
    scaled.point_rows = scale(T_point_[c.point], c.point_rows, c.point_error);
    if (c.frame >= 0) {
      scaled.frame_rows = scale(T_frame_[c.frame], c.frame_rows, c.frame_error);
    }
    result.columns.push_back(scaled);
  }
  result.matrix_error = std::sqrt(sum) * kOutward;
  result.bound_length = BoundLength();
  return result;
}

Real Scaling::BoundLength() const {
  Real sum = 0;
  for (size_t k = 0; k < num_points_; ++k) {
    sum += (T_point_[k].cwiseAbs() * system_.point_bound[k].cast<Real>())
               .squaredNorm();
  }
  for (size_t f = 0; f < num_frames_; ++f) {
    sum += (T_frame_[f].cwiseAbs() * system_.frame_bound[f].cast<Real>())
               .squaredNorm();
  }
  return std::sqrt(sum) * kOutward;
}

}  // namespace

std::optional<ScaledSystem> ScaleBlocks(const UncertainSystem& system) {
  Scaling scaling(system);
  if (!scaling.Find()) return std::nullopt;
  ScaledSystem scaled = scaling.Apply();
  if (!std::isfinite(scaled.matrix_error) ||
      !std::isfinite(scaled.bound_length)) {
    return std::nullopt;
  }
  return scaled;
}

}  // namespace krot
