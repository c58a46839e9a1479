#include "krot/adjust/precision_system.h"

#include "krot/linear/blocks.h"

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;

// An unknown is not determined if a motion that changes no error moves it by
// more than this share of its largest move.
constexpr double kMoves = 1e-6;

// A point's rows of C B (G'B)^-1, given those of the blocks.
MatrixXd PointW(const TrackRows& rows, const MatrixXd& held,
                const MatrixXd& W) {
  return rows.Solve(rows.SolveTransposed(held) - rows.G() * rows.Pick(W));
}

// Subtracts gauge motions from each motion so that it moves as few blocks as
// possible: least is the sum of what they move by, by iterated weights.
void TakeOffGauge(const MatrixXd& gauge, MatrixXd* motions) {
  for (Index c = 0; c < motions->cols(); ++c) {
    auto motion = motions->col(c);
    for (int i = 0; i < 50; ++i) {
      const double still = 1e-12 * motion.norm();
      MatrixXd weighted = gauge;
      for (Index n = 0; n < gauge.rows(); n += 3) {
        weighted.middleRows<3>(n) /= motion.segment<3>(n).norm() + still;
      }
      motion -= gauge * (InverseOf(weighted.transpose() * gauge).matrix *
                         (weighted.transpose() * motion));
    }
  }
}

}  // namespace

BlockCovariance::BlockCovariance(const AdjustmentColumns& columns,
                                 const AdjustmentBlocks& blocks,
                                 const std::vector<ComponentGauge>& gauges,
                                 int num_threads)
    : columns_(columns),
      gauges_(gauges),
      num_threads_(num_threads),
      size_(3 * Index{columns.num_blocks}),
      jacobians_(columns, blocks),
      begin_(PointBegins(blocks)),
      position_of_(blocks.points.size(), nullptr),
      gauge_of_(blocks.points.size(), {-1, 0}) {
  for (size_t c = 0; c < gauges_.size(); ++c) {
    for (size_t n = 0; n < gauges_[c].points.size(); ++n) {
      gauge_of_[gauges_[c].points[n]] = {static_cast<int>(c),
                                         static_cast<Index>(n)};
    }
  }
  for (const PositionObservation& position : blocks.positions) {
    const int32_t point = position.of.point;
    if (point >= 0 && columns.IsEliminated(point)) {
      position_of_[point] = &position;
    }
  }
  jacobians_.Evaluate(blocks, num_threads);
  Reduce(blocks);
  Invert();
  TakeDatum();
}

void BlockCovariance::Reduce(const AdjustmentBlocks& blocks) {
  C_.setZero(size_, size_);
  scale_.setZero(size_);
  const auto num_points = static_cast<int64_t>(begin_.size()) - 1;
  for (int64_t k = 0; k < num_points; ++k) {
    if (begin_[k] == begin_[k + 1]) continue;
    const TrackRows rows = RowsOf(k);
    if (columns_.IsEliminated(k)) num_undetermined_ += rows.NumUndetermined();
    for (int64_t i = rows.begin(); i < rows.end(); ++i) {
      const int32_t* own = jacobians_.blocks(i);
      for (int a = 0; a < rows.num_blocks(i); ++a) {
        scale_.segment<3>(3 * Index{own[a]}) +=
            rows.F(i, a).colwise().squaredNorm().transpose();
        for (int b = 0; b < rows.num_blocks(i); ++b) {
          AddToBlocks(own[a], own[b], rows.F(i, a).transpose() * rows.F(i, b));
        }
      }
    }
    const std::vector<int32_t>& of_track = rows.blocks();
    for (size_t a = 0; a < of_track.size(); ++a) {
      const Matrix3d G_a = rows.G().middleCols<3>(static_cast<Index>(3 * a));
      for (size_t b = 0; b < of_track.size(); ++b) {
        AddToBlocks(of_track[a], of_track[b],
                    -G_a.transpose() *
                        rows.G().middleCols<3>(static_cast<Index>(3 * b)));
      }
    }
  }
  for (const PositionObservation& position : blocks.positions) {
    const int32_t point = position.of.point;
    if (point >= 0 && columns_.IsEliminated(point)) continue;
    const BlockJacobian of =
        DifferentiatePosition(columns_, blocks, position.of);
    AddRows(of.blocks, position.px_from_world * of.J);
  }
  for (const DistanceObservation& distance : blocks.distances) {
    const BlockJacobian of =
        DifferentiateLength(columns_, blocks, distance.ends);
    AddRows(of.blocks, distance.px_from_world * of.J);
  }
}

void BlockCovariance::AddRows(const std::vector<int32_t>& blocks,
                              const MatrixXd& J) {
  for (size_t a = 0; a < blocks.size(); ++a) {
    const auto J_a = J.middleCols<3>(static_cast<Index>(3 * a));
    scale_.segment<3>(3 * Index{blocks[a]}) +=
        J_a.colwise().squaredNorm().transpose();
    for (size_t b = 0; b < blocks.size(); ++b) {
      AddToBlocks(blocks[a], blocks[b],
                  J_a.transpose() * J.middleCols<3>(static_cast<Index>(3 * b)));
    }
  }
}

void BlockCovariance::Invert() {
  std::vector<char> is_unknown(size_, 1);
  for (const AdjustmentColumns::Camera& camera : columns_.cameras) {
    for (Index n = static_cast<Index>(camera.params.size());
         n < 3 * Index{camera.num_blocks()}; ++n) {
      is_unknown[3 * camera.first_block + n] = 0;
    }
  }
  for (Index n = 0; n < size_; ++n) {
    scale_[n] = scale_[n] > 0 ? 1 / std::sqrt(scale_[n]) : 1;
  }
  C_ = scale_.asDiagonal() * C_ * scale_.asDiagonal();
  for (Index n = 0; n < size_; ++n) {
    if (is_unknown[n] == 0) C_(n, n) = 1;
  }
  for (const ComponentGauge& gauge : gauges_) {
    const MatrixXd moves = scale_.cwiseInverse().asDiagonal() * gauge.blocks;
    C_.noalias() += moves * (InverseOf(moves.transpose() * moves).matrix *
                             moves.transpose());
  }
  MatrixXd motions = InvertSemidefinite(num_threads_, &C_);
  num_undetermined_ += motions.cols();
  C_ = scale_.asDiagonal() * C_ * scale_.asDiagonal();
  is_determined_.assign(size_, 1);
  for (const ComponentGauge& gauge : gauges_) {
    TakeOffGauge(scale_.cwiseInverse().asDiagonal() * gauge.blocks, &motions);
  }
  for (Index c = 0; c < motions.cols(); ++c) {
    const double largest = motions.col(c).cwiseAbs().maxCoeff();
    for (Index n = 0; n < size_; ++n) {
      if (std::abs(motions(n, c)) > kMoves * largest) {
        is_determined_[n] = 0;
      } else {
        motions(n, c) = 0;
      }
    }
  }
  motions_ = scale_.asDiagonal() * motions;
}

bool BlockCovariance::IsDetermined(const TrackRows& rows) const {
  if (rows.NumUndetermined() > 0) return false;
  const MatrixXd by_blocks = rows.Solve(rows.G());
  const MatrixXd motions = rows.Pick(motions_);
  return (by_blocks * motions).norm() <=
         kMoves * by_blocks.norm() * motions.norm();
}

// B (G'B)^-1. What is not determined holds nothing, and has no rows in B.
void BlockCovariance::HoldDetermined(const ComponentGauge& gauge,
                                     MatrixXd* held_blocks,
                                     MatrixXd* held_points) const {
  *held_blocks = gauge.held_blocks;
  *held_points = gauge.held_points;
  for (Index n = 0; n < size_; ++n) {
    if (is_determined_[n] == 0) held_blocks->row(n).setZero();
  }
  for (size_t n = 0; n < gauge.points.size(); ++n) {
    if (IsDetermined(RowsOf(gauge.points[n]))) continue;
    held_points->middleRows<3>(static_cast<Index>(3 * n)).setZero();
  }
  const auto invert = [&] {
    return InverseOf(gauge.blocks.transpose() * *held_blocks +
                     gauge.of_points.transpose() * *held_points);
  };
  LuInverse inverse = invert();
  if (!inverse.exists) {  // Nothing of it is determined: use all of B.
    *held_blocks = gauge.held_blocks;
    *held_points = gauge.held_points;
    inverse = invert();
  }
  *held_blocks *= inverse.matrix;
  *held_points *= inverse.matrix;
}

void BlockCovariance::TakeDatum() {
  for (const ComponentGauge& gauge : gauges_) {
    DatumChange change;
    MatrixXd held_blocks;
    HoldDetermined(gauge, &held_blocks, &change.held_points);
    MatrixXd rhs = held_blocks;
    for (size_t n = 0; n < gauge.points.size(); ++n) {
      const TrackRows rows = RowsOf(gauge.points[n]);
      const MatrixXd own =
          rows.G().transpose() *
          rows.SolveTransposed(
              change.held_points.middleRows<3>(static_cast<Index>(3 * n)));
      for (size_t a = 0; a < rows.blocks().size(); ++a) {
        rhs.middleRows<3>(3 * rows.blocks()[a]) -=
            own.middleRows<3>(static_cast<Index>(3 * a));
      }
    }
    change.W = C_ * rhs;
    change.T = held_blocks.transpose() * change.W;
    for (size_t n = 0; n < gauge.points.size(); ++n) {
      const auto own =
          change.held_points.middleRows<3>(static_cast<Index>(3 * n));
      change.T +=
          own.transpose() * PointW(RowsOf(gauge.points[n]), own, change.W);
    }
    changes_.push_back(std::move(change));
  }
}

MatrixXd BlockCovariance::TimesG(const TrackRows& rows) const {
  const std::vector<int32_t>& blocks = rows.blocks();
  MatrixXd product = MatrixXd::Zero(rows.G().cols(), 3);
  for (size_t b = 0; b < blocks.size(); ++b) {
    const Matrix3d G_b =
        rows.G().middleCols<3>(static_cast<Index>(3 * b)).transpose();
    for (size_t a = 0; a < blocks.size(); ++a) {
      product.middleRows<3>(static_cast<Index>(3 * a)) +=
          C_.block<3, 3>(3 * Index{blocks[a]}, 3 * Index{blocks[b]}) * G_b;
    }
  }
  return product;
}

std::optional<MatrixXd> BlockCovariance::Covariance(
    const MatrixXd& J, const std::vector<int32_t>& blocks) const {
  MatrixXd C(J.cols(), J.cols());
  const auto count = static_cast<Index>(blocks.size());
  for (Index a = 0; a < count; ++a) {
    for (int c = 0; c < 3; ++c) {
      const bool is_used = !J.col(3 * a + c).isZero(0);
      if (is_used && is_determined_[3 * blocks[a] + c] == 0) {
        return std::nullopt;
      }
    }
    for (Index b = 0; b < count; ++b) {
      Matrix3d block = C_.block<3, 3>(3 * blocks[a], 3 * blocks[b]);
      for (size_t g = 0; g < gauges_.size(); ++g) {
        const auto G_a = gauges_[g].blocks.middleRows<3>(3 * blocks[a]);
        const auto G_b = gauges_[g].blocks.middleRows<3>(3 * blocks[b]);
        const auto W_a = changes_[g].W.middleRows<3>(3 * blocks[a]);
        const auto W_b = changes_[g].W.middleRows<3>(3 * blocks[b]);
        block += G_a * changes_[g].T * G_b.transpose() - G_a * W_b.transpose() -
                 W_a * G_b.transpose();
      }
      C.block<3, 3>(3 * a, 3 * b) = block;
    }
  }
  return J * C * J.transpose();
}

PointCovariance::PointCovariance(const BlockCovariance& all, int64_t k)
    : all_(all),
      k_(k),
      rows_(all.RowsOf(k)),
      C_G_(all.TimesG(rows_)),
      G_C_G_(rows_.G() * C_G_) {}

Matrix2d PointCovariance::RedundancyOf(int64_t i) const {
  const MatrixXd& C = all_.C_;
  const TrackRows::Matrix23 Q = rows_.Q(i);
  Matrix2d R = Matrix2d::Identity() -
               Q * (Matrix3d::Identity() + G_C_G_) * Q.transpose();
  const int32_t* own = all_.jacobians_.blocks(i);
  for (int a = 0; a < rows_.num_blocks(i); ++a) {
    const Matrix2d across =
        rows_.F(i, a) * C_G_.middleRows<3>(rows_.Slot(i, a)) * Q.transpose();
    R += across + across.transpose();
    for (int b = 0; b < rows_.num_blocks(i); ++b) {
      R -= rows_.F(i, a) * C.block<3, 3>(3 * Index{own[a]}, 3 * Index{own[b]}) *
           rows_.F(i, b).transpose();
    }
  }
  return R;
}

std::optional<Matrix3d> PointCovariance::OfPoint() const {
  if (!all_.columns_.point_moves[k_]) return Matrix3d::Zero();
  const int32_t block = all_.columns_.kept_points[k_];
  if (block != AdjustmentColumns::kHeld) {
    const auto of_block = all_.Covariance(Matrix3d::Identity(), {block});
    if (!of_block) return std::nullopt;
    return Matrix3d(*of_block);
  }
  if (!all_.IsDetermined(rows_)) return std::nullopt;
  // R^-1 (I + G C G') R^-T
  Matrix3d covariance =
      rows_.Solve(rows_.Solve(Matrix3d::Identity() + G_C_G_).transpose());
  const auto [c, slot] = all_.gauge_of_[k_];
  if (c < 0) return covariance;
  const auto rows_of = [slot = slot](const MatrixXd& of_points) {
    return of_points.middleRows<3>(3 * slot);
  };
  const BlockCovariance::DatumChange& change = all_.changes_[c];
  const MatrixXd G = rows_of(all_.gauges_[c].of_points);
  const MatrixXd W = PointW(rows_, rows_of(change.held_points), change.W);
  covariance +=
      G * change.T * G.transpose() - G * W.transpose() - W * G.transpose();
  return covariance;
}

}  // namespace krot::internal
