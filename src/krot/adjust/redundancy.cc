#include "krot/adjust/redundancy.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include <Eigen/Cholesky>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/adjustment_columns.h"
#include "krot/adjust/reprojection_errors.h"
#include "krot/base/parallel_for.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;

constexpr double kGauge = 1e-10;
// Of H's largest diagonal entry: a point whose depth nothing tells has one.
constexpr double kDepth = 1e-12;
constexpr int64_t kPointsPerChunk = 64;
using Rows = Eigen::Matrix<double, 2, Eigen::Dynamic>;

// The rows of one point's observations.
struct TrackRows {
  std::vector<int32_t> blocks;  // on which they depend, ascending
  std::vector<Eigen::Matrix<double, 2, 3>> A;
  std::vector<Rows> F;  // by `blocks`
  Matrix3d H_inverse = Matrix3d::Zero();
  Eigen::Matrix<double, 3, Eigen::Dynamic> AF;  // A'F

  // Of observations begin..end - 1.
  TrackRows(const ErrorJacobians& jacobians, bool moves, int64_t begin,
            int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const int32_t* own = jacobians.blocks(i);
      blocks.insert(blocks.end(), own, own + jacobians.num_blocks(i));
    }
    std::sort(blocks.begin(), blocks.end());
    blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
    const auto width = 3 * static_cast<Eigen::Index>(blocks.size());
    AF.setZero(3, width);
    Matrix3d H = Matrix3d::Zero();
    for (int64_t i = begin; i < end; ++i) {
      A.push_back(jacobians.by_point(i).topRows<2>());
      Rows rows = Rows::Zero(2, width);
      for (int n = 0; n < jacobians.num_blocks(i); ++n) {
        const auto slot = std::lower_bound(blocks.begin(), blocks.end(),
                                           jacobians.blocks(i)[n]) -
                          blocks.begin();
        rows.middleCols<3>(3 * slot) += jacobians.by_block(i, n).topRows<2>();
      }
      H += A.back().transpose() * A.back();
      AF += A.back().transpose() * rows;
      F.push_back(std::move(rows));
    }
    if (!moves) return;
    H.diagonal().array() += kDepth * H.diagonal().maxCoeff();
    H_inverse = H.llt().solve(Matrix3d::Identity());
  }
};

}  // namespace

std::vector<Eigen::Matrix2d> ExactRedundancy(
    const Model& model, const BundleAdjustmentOptions& options,
    const Context& context) {
  const AdjustmentBlocks blocks =
      MakeAdjustmentBlocks(model, options.min_track_length, options.fixed);
  const AdjustmentColumns columns(options, blocks);
  ErrorJacobians jacobians(columns, blocks);
  jacobians.Evaluate(blocks, context.num_threads);
  const auto num_points = static_cast<int64_t>(blocks.points.size());
  std::vector<int64_t> begin(num_points + 1, 0);
  for (const AdjustmentObservation& o : blocks.observations) {
    ++begin[o.point + 1];
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  const auto rows_of = [&](int64_t k) {
    return TrackRows(jacobians, columns.point_moves[k] != 0, begin[k],
                     begin[k + 1]);
  };

  const int64_t size = 3 * static_cast<int64_t>(columns.num_blocks);
  MatrixXd S = MatrixXd::Zero(size, size);
  for (int64_t k = 0; k < num_points; ++k) {
    const TrackRows rows = rows_of(k);
    MatrixXd part = -rows.AF.transpose() * rows.H_inverse * rows.AF;
    for (const Rows& F : rows.F) part += F.transpose() * F;
    const std::vector<int32_t>& block = rows.blocks;
    const auto num_blocks = static_cast<Eigen::Index>(block.size());
    for (Eigen::Index a = 0; a < num_blocks; ++a) {
      for (Eigen::Index b = 0; b < num_blocks; ++b) {
        S.block<3, 3>(3 * block[a], 3 * block[b]) +=
            part.block<3, 3>(3 * a, 3 * b);
      }
    }
  }
  // Columns to spare stand for nothing.
  for (int64_t c = 0; c < size; ++c) {
    S(c, c) = S(c, c) > 0 ? (1 + kGauge) * S(c, c) : 1;
  }
  const MatrixXd inverse = S.llt().solve(MatrixXd::Identity(size, size));

  std::vector<Eigen::Matrix2d> redundancy(
      model.track_elements.size(),
      Eigen::Matrix2d::Constant(std::numeric_limits<double>::quiet_NaN()));
  ParallelFor(
      num_points, kPointsPerChunk, context.num_threads,
      [&](int64_t first, int64_t end, int) {
        for (int64_t k = first; k < end; ++k) {
          const TrackRows rows = rows_of(k);
          const std::vector<int32_t>& block = rows.blocks;
          const auto num_blocks = static_cast<Eigen::Index>(block.size());
          MatrixXd of_track(3 * num_blocks, 3 * num_blocks);
          for (Eigen::Index a = 0; a < num_blocks; ++a) {
            for (Eigen::Index b = 0; b < num_blocks; ++b) {
              of_track.block<3, 3>(3 * a, 3 * b) =
                  inverse.block<3, 3>(3 * block[a], 3 * block[b]);
            }
          }
          for (int64_t i = begin[k]; i < begin[k + 1]; ++i) {
            const auto& A = rows.A[i - begin[k]];
            const Rows C = rows.F[i - begin[k]] - A * rows.H_inverse * rows.AF;
            redundancy[blocks.observations[i].element] =
                Eigen::Matrix2d::Identity() -
                A * rows.H_inverse * A.transpose() -
                C * of_track * C.transpose();
          }
        }
      });
  return redundancy;
}

}  // namespace krot::internal
