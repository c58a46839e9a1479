#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/linear/ordered_sums.h"
#include "krot/linear/schur_complement.h"

namespace krot::internal {

// The slack of an error below the cap.
inline double Slack(double cap2, double squared_error) {
  return (cap2 - squared_error) / 2;
}

// Newton's system of bounded bundle adjustment,
//
//   min sum |r|^2 / 2 - mu sum log(h) + cap_weight cap2 / 2,
//   h = (cap2 - |r|^2) / 2,
//
// at an iterate with multipliers lambda of h >= 0. An observation with depth w
// and derivatives D of (r, w), adjustment_blocks.h, has the rows of least
// squares
//
//   K D,   K = [ sqrt(1 + lambda) I2                             ]
//              [ sqrt(lambda / h) r'     -sqrt(lambda / h) h / w ]
//
// and -sqrt(lambda / h) / 2 in the third row for cap2. The squares of the rows
// add up to the matrix of the primal-dual method [Nocedal, Wright 2006,
// Sec. 19.3] for the constraint w h >= 0, with w kept where it scales the
// multiplier. As w r and w are affine in translations and points, the curvature
// of w^2 h is -J'J, J = dr: so the entry of dw stands for the second
// derivatives of r. Without it, steps along a cap with large multipliers are
// short.
//
// The points are eliminated. The "frames" of the reduced camera system are the
// blocks of AdjustmentColumns. As the gauge is free, the diagonal is raised by
// its share 1 / radius.
class BarrierSystem {
 public:
  using Matrix3d = Eigen::Matrix3d;
  using Vector3d = Eigen::Vector3d;

  // Keeps a reference to `columns`.
  BarrierSystem(const AdjustmentColumns& columns,
                const AdjustmentBlocks& blocks, int num_threads)
      : columns_(columns),
        loop_(static_cast<int64_t>(blocks.observations.size()), num_threads),
        jacobians_(columns, blocks),
        observation_begin_(PointBegins(blocks)),
        structure_(FindStructure(blocks)),
        schur_(structure_, {num_threads}),
        L_inverse_(blocks.points.size()),
        part_diagonal_(schur_.reduced().num_parts()),
        part_gradient_(schur_.reduced().num_parts()) {}

  // Computes the derivatives at an iterate whose errors are below the cap.
  // `errors` and `multipliers` must outlive the calls below.
  void Linearize(const AdjustmentBlocks& blocks,
                 const std::vector<ProjectedError>& errors,
                 const std::vector<double>& multipliers) {
    errors_ = &errors;
    multipliers_ = &multipliers;
    cap2_ = blocks.cap2;
    jacobians_.Evaluate(blocks, loop_.num_threads());
  }

  // Returns false if there is no factor.
  bool Factorize(double radius) {
    diagonal_.SetZero(structure_.num_points(), columns_.num_blocks);
    for (std::vector<Vector3d>& part : part_diagonal_) {
      part.assign(columns_.num_blocks, Vector3d::Zero());
    }
    schur_.AddPoints(
        [&](int64_t k, int part) { AddPoint(k, 1 / radius, part); });
    AddParts(part_diagonal_, &diagonal_.frames);
    for (int32_t b = 0; b < columns_.num_blocks; ++b) {
      const Matrix3d damping = (diagonal_.frames[b] / radius).asDiagonal();
      schur_.reduced().AddBlock(0, b, b, damping.data());
    }
    return schur_.Factorize();
  }

  // Finds Newton's direction.
  void Solve(double mu, double cap_weight) {
    mu_ = mu;
    const auto num_blocks = static_cast<size_t>(columns_.num_blocks);
    gradient_.SetZero(structure_.num_points(), columns_.num_blocks);
    direction_.unknowns.SetZero(structure_.num_points(), columns_.num_blocks);
    direction_.slopes.resize(loop_.count());
    for (std::vector<Vector3d>& part : part_gradient_) {
      part.assign(num_blocks, Vector3d::Zero());
    }
    std::vector<Vector3d> of_cap(num_blocks, Vector3d::Zero());
    if (MovesCap()) of_cap[columns_.cap][0] = cap_weight / 2;
    std::vector<Vector3d>& moves = direction_.unknowns.frames;
    schur_.Solve(
        [&](int64_t k, int part, double* rhs) { ReducePoint(k, part, rhs); },
        &of_cap, SchurComplement::kTolerance, &moves);
    for (Vector3d& move : moves) move = -move;
    AddParts(part_gradient_, &gradient_.frames);
    if (MovesCap()) gradient_.frames[columns_.cap] += of_cap[columns_.cap];
    schur_.ForEachPoint([&](int64_t k) { BackSubstitute(k); });
  }

  // The direction of the unknowns, and the slopes of (r, w) along it.
  struct Direction {
    BlockVector unknowns;
    std::vector<Eigen::Vector3d> slopes;
  };
  const Direction& direction() const { return direction_; }
  double cap2_slope() const {
    return MovesCap() ? direction_.unknowns.frames[columns_.cap][0] : 0;
  }

  // g' D^-1 g / 2 of the last Solve, with g the gradient of what is minimised
  // and D the diagonal of the system: to first order, the sum of the gains of
  // moving each unknown alone.
  double SingleGains() const {
    double sum = 0;
    const auto add = [&](const Vector3d& gradient, const Vector3d& diagonal) {
      for (int c = 0; c < 3; ++c) {
        if (diagonal[c] > 0) sum += gradient[c] * gradient[c] / diagonal[c];
      }
    };
    for (size_t k = 0; k < gradient_.points.size(); ++k) {
      add(gradient_.points[k], diagonal_.points[k]);
    }
    for (size_t b = 0; b < gradient_.frames.size(); ++b) {
      add(gradient_.frames[b], diagonal_.frames[b]);
    }
    return sum / 2;
  }

  const ObservationLoop& loop() const { return loop_; }
  ReducedCameraSystem::Kind kind() const { return schur_.reduced().kind(); }

 private:
  // The most blocks of an observation: the poses of its frame and sensor,
  // sixteen parameters, and the cap.
  static constexpr int kMaxBlocks = 4 + 6 + 1;

  // The blocks that every point depends on.
  BlockStructure FindStructure(const AdjustmentBlocks& blocks) const {
    BlockStructure structure;
    structure.point_begin.assign(1, 0);
    structure.frame_is_fixed.assign(columns_.num_blocks, 0);
    for (size_t k = 0; k < blocks.points.size(); ++k) {
      const std::vector<int32_t> seen = jacobians_.BlocksOf(begin(k), end(k));
      structure.frame_of.insert(structure.frame_of.end(), seen.begin(),
                                seen.end());
      structure.point_begin.push_back(
          static_cast<int64_t>(structure.frame_of.size()));
    }
    return structure;
  }
  // The observations of a point.
  int64_t begin(int64_t k) const { return observation_begin_[k]; }
  int64_t end(int64_t k) const { return observation_begin_[k + 1]; }

  // Adds up the parts in their order.
  static void AddParts(const std::vector<std::vector<Vector3d>>& parts,
                       std::vector<Vector3d>* sum) {
    *sum = parts[0];
    for (size_t part = 1; part < parts.size(); ++part) {
      for (size_t b = 0; b < sum->size(); ++b) (*sum)[b] += parts[part][b];
    }
  }
  double SlackOf(int64_t i) const {
    return Slack(cap2_, (*errors_)[i].r.squaredNorm());
  }
  // Computes K D by the point and by the blocks, and returns the number of
  // blocks.
  int Rows(int64_t i, Eigen::Matrix3d* by_point,
           Eigen::Matrix3d* by_block) const {
    const ProjectedError& error = (*errors_)[i];
    const double lambda = (*multipliers_)[i];
    const double h = SlackOf(i);
    const double curvature = std::sqrt(1 + lambda);
    const double third = std::sqrt(lambda / h);
    const Eigen::RowVector3d by_error(third * error.r.x(), third * error.r.y(),
                                      -third * h / error.w);
    const auto scale = [&](const Matrix3d& D, Matrix3d* rows) {
      rows->topRows<2>() = curvature * D.topRows<2>();
      rows->row(2).noalias() = by_error * D;
    };
    scale(jacobians_.by_point(i), by_point);
    const int num_blocks = jacobians_.num_blocks(i);
    for (int n = 0; n < num_blocks; ++n) {
      scale(jacobians_.by_block(i, n), &by_block[n]);
    }
    if (MovesCap()) by_block[num_blocks - 1](2, 0) = -third / 2;
    return num_blocks;
  }
  // K'K (dr; dw), and last the component by cap2.
  Eigen::Vector4d Weigh(int64_t i, const Eigen::Vector3d& change,
                        double cap2_change) const {
    const ProjectedError& error = (*errors_)[i];
    const double lambda = (*multipliers_)[i];
    const double h = SlackOf(i);
    const Eigen::Vector4d third(error.r.x(), error.r.y(), -h / error.w, -0.5);
    Eigen::Vector4d weighed =
        lambda / h * (third.head<3>().dot(change) + third[3] * cap2_change) *
        third;
    weighed.head<2>() += (1 + lambda) * change.head<2>();
    return weighed;
  }

  // Adds a point's part of the reduced camera system: F'F - E'H^-1 E, with rows
  // A by the point and F by the blocks, E = A'F and H = A'A.
  void AddPoint(int64_t k, double damping, int part) {
    thread_local std::vector<double> G[3];  // L^-1 E
    thread_local std::vector<int32_t> blocks;
    thread_local std::vector<char> is_apart;
    blocks.assign(structure_.frame_of.begin() + structure_.point_begin[k],
                  structure_.frame_of.begin() + structure_.point_begin[k + 1]);
    is_apart.assign(blocks.size(), 0);
    for (std::vector<double>& row : G) row.assign(3 * blocks.size(), 0.0);
    Matrix3d H = Matrix3d::Zero(), A, F[kMaxBlocks];
    for (int64_t i = begin(k); i < end(k); ++i) {
      const int num_blocks = Rows(i, &A, F);
      const int32_t* ids = jacobians_.blocks(i);
      H.noalias() += A.transpose() * A;
      for (int b = 0; b < num_blocks; ++b) {
        const Matrix3d E = A.transpose() * F[b];
        const int64_t slot =
            std::lower_bound(blocks.begin(), blocks.end(), ids[b]) -
            blocks.begin();
        for (int r = 0; r < 3; ++r) {
          for (int c = 0; c < 3; ++c) G[r][3 * slot + c] += E(r, c);
        }
        for (int c = 0; c <= b; ++c) {
          const Matrix3d block = F[b].transpose() * F[c];
          schur_.reduced().AddBlock(part, ids[b], ids[c], block.data());
          if (b == c) part_diagonal_[part][ids[b]] += block.diagonal();
        }
      }
    }
    if (!columns_.point_moves[k]) return;
    diagonal_.points[k] = H.diagonal();
    H.diagonal() *= 1 + damping;
    // Pivots are no smaller than this share of the trace.
    InvertCholesky(H, 1e-14 * H.trace(), &L_inverse_[k]);
    for (size_t c = 0; c < G[0].size(); ++c) {
      const Vector3d column =
          L_inverse_[k] * Vector3d(G[0][c], G[1][c], G[2][c]);
      for (int r = 0; r < 3; ++r) G[r][c] = column[r];
    }
    const double* const rows[3] = {G[0].data(), G[1].data(), G[2].data()};
    schur_.reduced().SubtractSquare(part, blocks, is_apart, rows);
  }

  // Adds a point's part of the gradient g, and of the right-hand side of the
  // reduced camera system, g_b - E'H^-1 g_k.
  void ReducePoint(int64_t k, int part, double* rhs) {
    const auto by_error = [&](int64_t i) -> Vector3d {
      const Eigen::Vector2d pull = (1 + mu_ / SlackOf(i)) * (*errors_)[i].r;
      return {pull.x(), pull.y(), 0};
    };
    Vector3d step = Vector3d::Zero();
    if (columns_.point_moves[k]) {
      Vector3d& gradient = gradient_.points[k];
      for (int64_t i = begin(k); i < end(k); ++i) {
        gradient.noalias() += jacobians_.by_point(i).transpose() * by_error(i);
      }
      step = -(L_inverse_[k].transpose() * (L_inverse_[k] * gradient));
    }
    for (int64_t i = begin(k); i < end(k); ++i) {
      const Vector3d pull = by_error(i);
      const Eigen::Vector4d weighed =
          Weigh(i, jacobians_.by_point(i) * step, 0);
      const Vector3d pull_left = pull + weighed.head<3>();
      for (int b = 0; b < jacobians_.num_blocks(i); ++b) {
        const int32_t id = jacobians_.blocks(i)[b];
        const Matrix3d& D = jacobians_.by_block(i, b);
        part_gradient_[part][id].noalias() += D.transpose() * pull;
        Vector3d::Map(rhs + 3 * id).noalias() += D.transpose() * pull_left;
      }
      if (MovesCap()) {
        const double by_cap2 = -mu_ / (2 * SlackOf(i));
        part_gradient_[part][columns_.cap][0] += by_cap2;
        rhs[3 * columns_.cap] += by_cap2 + weighed[3];
      }
    }
  }

  // Finds the point's direction and its observations' slopes once the direction
  // of the blocks is known.
  void BackSubstitute(int64_t k) {
    Vector3d rest = gradient_.points[k];
    for (int64_t i = begin(k); i < end(k); ++i) {
      Vector3d& slope = direction_.slopes[i];
      slope.setZero();
      for (int b = 0; b < jacobians_.num_blocks(i); ++b) {
        slope.noalias() += jacobians_.by_block(i, b) *
                           direction_.unknowns.frames[jacobians_.blocks(i)[b]];
      }
      rest.noalias() += jacobians_.by_point(i).transpose() *
                        Weigh(i, slope, cap2_slope()).head<3>();
    }
    if (!columns_.point_moves[k] || begin(k) == end(k)) return;
    Vector3d& step = direction_.unknowns.points[k];
    step = -(L_inverse_[k].transpose() * (L_inverse_[k] * rest));
    for (int64_t i = begin(k); i < end(k); ++i) {
      direction_.slopes[i].noalias() += jacobians_.by_point(i) * step;
    }
  }

  bool MovesCap() const { return columns_.cap != AdjustmentColumns::kHeld; }

  const AdjustmentColumns& columns_;
  const ObservationLoop loop_;
  ErrorJacobians jacobians_;
  std::vector<int64_t> observation_begin_;  // by point
  const BlockStructure structure_;
  SchurComplement schur_;

  const std::vector<ProjectedError>* errors_ = nullptr;
  const std::vector<double>* multipliers_ = nullptr;
  double cap2_ = 0;
  double mu_ = 0;
  std::vector<Eigen::Matrix3d> L_inverse_;  // of points, H = L L'
  BlockVector diagonal_;
  BlockVector gradient_;
  Direction direction_;
  // Sums over the blocks' observations, one for each part of the loop.
  std::vector<std::vector<Eigen::Vector3d>> part_diagonal_, part_gradient_;
};

}  // namespace krot::internal
