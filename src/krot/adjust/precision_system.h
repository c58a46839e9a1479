#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/context.h"
#include "krot/linear/blocks.h"
#include "krot/model.h"

namespace krot::internal {

// The rows [A F] of one point's observations and, with F = 0, of its known
// position; the point is eliminated by A = Q R, so that (A'A)^-1 = R^-1 R^-T.
class TrackRows {
 public:
  using Index = Eigen::Index;
  using MatrixXd = Eigen::MatrixXd;
  using Matrix23 = Eigen::Matrix<double, 2, 3>;

  // Takes observations begin, ..., end - 1; `position` may be null. Keeps a
  // reference to the derivatives. A point that is not eliminated has Q = 0.
  TrackRows(const ErrorJacobians& jacobians, bool eliminates, int64_t begin,
            int64_t end, const PositionObservation* position)
      : jacobians_(jacobians),
        begin_(begin),
        end_(end),
        blocks_(jacobians.BlocksOf(begin, end)) {
    for (int64_t i = begin; i < end; ++i) {
      for (int r = 0; r < 2; ++r) {
        for (int c = 0; c < 3; ++c) {
          Q_.push_back(eliminates ? jacobians.by_point(i)(r, c) : 0);
        }
      }
    }
    if (position != nullptr) {
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) {
          Q_.push_back(position->px_from_world(r, c));
        }
      }
    }
    R_ = Orthogonalize(static_cast<int64_t>(Q_.size()) / 3, Q_.data());
    G_.setZero(3, 3 * static_cast<Index>(blocks_.size()));
    for (int64_t i = begin; i < end; ++i) {
      for (int n = 0; n < jacobians.num_blocks(i); ++n) {
        G_.middleCols<3>(Slot(i, n)) += Q(i).transpose() * F(i, n);
      }
    }
  }

  // The blocks on which the rows depend, ascending.
  const std::vector<int32_t>& blocks() const { return blocks_; }
  int64_t begin() const { return begin_; }
  int64_t end() const { return end_; }
  int num_blocks(int64_t i) const { return jacobians_.num_blocks(i); }
  // The derivatives of observation i by its block n, and its first column among
  // those of blocks().
  Matrix23 F(int64_t i, int n) const {
    return jacobians_.by_block(i, n).topRows<2>();
  }
  Index Slot(int64_t i, int n) const {
    return 3 * (std::lower_bound(blocks_.begin(), blocks_.end(),
                                 jacobians_.blocks(i)[n]) -
                blocks_.begin());
  }
  Matrix23 Q(int64_t i) const {
    return Eigen::Map<const Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>(
        &Q_[6 * (i - begin_)]);
  }
  const MatrixXd& G() const { return G_; }  // Q'F

  // How many of the point's three unknowns are not determined.
  int NumUndetermined() const {
    return static_cast<int>(std::isinf(R_.r00)) + std::isinf(R_.r11) +
           std::isinf(R_.r22);
  }
  MatrixXd Solve(const MatrixXd& b) const {  // R^-1 b
    MatrixXd x(3, b.cols());
    for (Index c = 0; c < b.cols(); ++c) x.col(c) = R_.Solve(b.col(c));
    return x;
  }
  MatrixXd SolveTransposed(const MatrixXd& b) const {  // R^-T b
    MatrixXd x(3, b.cols());
    for (Index c = 0; c < b.cols(); ++c) {
      x.col(c) = R_.SolveTransposed(b.col(c));
    }
    return x;
  }
  // The rows of `all` that belong to the track's blocks.
  MatrixXd Pick(const MatrixXd& all) const {
    MatrixXd own(3 * static_cast<Index>(blocks_.size()), all.cols());
    for (size_t a = 0; a < blocks_.size(); ++a) {
      own.middleRows<3>(static_cast<Index>(3 * a)) =
          all.middleRows<3>(3 * Index{blocks_[a]});
    }
    return own;
  }

 private:
  const ErrorJacobians& jacobians_;
  const int64_t begin_, end_;
  const std::vector<int32_t> blocks_;
  std::vector<double> Q_;  // 3 columns, row by row; 2 rows per observation
  UpperTriangle R_;
  MatrixXd G_;
};

// ---- The datum ----

// The motions of a connected component that change no error, as columns, and
// what the datum holds of them.
struct ComponentGauge {
  Eigen::MatrixXd blocks;       // 3 num_blocks x q: how the blocks move
  std::vector<int32_t> points;  // that move, ascending
  Eigen::MatrixXd of_points;    // 3 points.size() x q
  // B, with the same rows: the datum is B'x = 0.
  Eigen::MatrixXd held_blocks;
  Eigen::MatrixXd held_points;

  int64_t size() const { return blocks.cols(); }
};

// One for each component that can move in some way without changing an error.
// O(observations).
std::vector<ComponentGauge> FindGauges(const BundleAdjustmentOptions& options,
                                       const AdjustmentColumns& columns,
                                       const AdjustmentBlocks& blocks,
                                       AdjustmentDatum datum);

// ---- Covariances, for noise of one pixel ----

// The covariance of all unknowns besides the points that are eliminated, by
// inverting their reduced camera system,
//
//   C = (sum F'F - G'G)^-,   x_k = R^-1 (Q'r - G t) for the point,
//
// where what the gauge leaves free is held; then S C S' is in the datum.
class BlockCovariance {
 public:
  // Keeps references to all but the observations of `blocks`.
  BlockCovariance(const AdjustmentColumns& columns,
                  const AdjustmentBlocks& blocks,
                  const std::vector<ComponentGauge>& gauges, int num_threads);

  // Unknowns beyond the gauge that no observation determines.
  int64_t num_undetermined() const { return num_undetermined_; }

  // J S C S' J', where J has columns for `blocks`; none if J needs an unknown
  // that is not determined.
  std::optional<Eigen::MatrixXd> Covariance(
      const Eigen::MatrixXd& J, const std::vector<int32_t>& blocks) const;

 private:
  friend class PointCovariance;

  // W = C B (G'B)^-1 and T = (B'G)^-1 B'W of a gauge, by which S C S' = C -
  // G W' - W G' + G T G', S = I - G (B'G)^-1 B'.
  struct DatumChange {
    Eigen::MatrixXd held_points;  // B (G'B)^-1
    Eigen::MatrixXd W;            // of blocks
    Eigen::MatrixXd T;
  };

  void Reduce(const AdjustmentBlocks& blocks);
  void AddRows(const std::vector<int32_t>& blocks, const Eigen::MatrixXd& J);
  void AddToBlocks(int32_t a, int32_t b, const Eigen::Matrix3d& block) {
    C_.block<3, 3>(3 * Eigen::Index{a}, 3 * Eigen::Index{b}) += block;
  }
  void Invert();
  void TakeDatum();
  void HoldDetermined(const ComponentGauge& gauge, Eigen::MatrixXd* held_blocks,
                      Eigen::MatrixXd* held_points) const;
  bool IsDetermined(const TrackRows& rows) const;  // the point
  TrackRows RowsOf(int64_t k) const {
    return {jacobians_, columns_.IsEliminated(k), begin_[k], begin_[k + 1],
            position_of_[k]};
  }
  Eigen::MatrixXd TimesG(const TrackRows& rows) const;  // C G'

  const AdjustmentColumns& columns_;
  const std::vector<ComponentGauge>& gauges_;
  const int num_threads_;
  const Eigen::Index size_;
  ErrorJacobians jacobians_;
  std::vector<int64_t> begin_;  // of points' observations; num_points + 1
  // For each point that is eliminated its position, or null.
  std::vector<const PositionObservation*> position_of_;
  // For each point its gauge, -1: none, and its place among the gauge's points.
  std::vector<std::pair<int, Eigen::Index>> gauge_of_;
  Eigen::VectorXd scale_;  // of unknowns: units in which diagonals are 1
  Eigen::MatrixXd C_;
  Eigen::MatrixXd motions_;  // that change no error
  std::vector<char> is_determined_;
  std::vector<DatumChange> changes_;
  int64_t num_undetermined_ = 0;
};

// The covariance of a point and the redundancy of its observations. Different
// points may be asked for at the same time.
class PointCovariance {
 public:
  // Keeps a reference.
  PointCovariance(const BlockCovariance& all, int64_t k);

  // I - Q Q' - (F - Q G) C (F - Q G)' of one of its observations.
  Eigen::Matrix2d RedundancyOf(int64_t i) const;
  // The point's covariance in the datum; none if it is not determined.
  std::optional<Eigen::Matrix3d> OfPoint() const;

 private:
  const BlockCovariance& all_;
  const int64_t k_;
  const TrackRows rows_;
  const Eigen::MatrixXd C_G_;    // C G'
  const Eigen::Matrix3d G_C_G_;  // G C G'
};

// ---- All of it ----

// The precision of the model's estimate as it stands, with equal weights. A
// point that lies in a camera that sees it says nothing about that camera's
// place, beside which all else would be rounding: it is left out.
// Beyond options.max_num_images_direct_sparse images there are no covariances
// and redundancy numbers: with n unknowns besides the points they take 16 n^2
// bytes and O(n^3). The same bits at any number of threads.
AdjustmentPrecision FindPrecision(const Model& model,
                                  const BundleAdjustmentOptions& options,
                                  const AdjustmentBlocks& blocks,
                                  AdjustmentDatum datum,
                                  const Context& context);

}  // namespace krot::internal
