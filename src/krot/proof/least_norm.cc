#include "krot/proof/dual_repair.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace krot::internal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Whether each column is independent, beyond rounding, of those before it.
bool AreIndependent(const Eigen::HouseholderQR<MatrixXd>& qr,
                    const VectorXd& squared_lengths) {
  const VectorXd left = qr.matrixQR().diagonal().cwiseAbs();
  const VectorXd lengths = squared_lengths.cwiseSqrt();
  return lengths.allFinite() &&
         (left.array() >
          std::numeric_limits<double>::epsilon() * lengths.array())
             .all();
}

// R^-T b.
VectorXd SolveTransposedR(const Eigen::HouseholderQR<MatrixXd>& qr,
                          const VectorXd& b) {
  return qr.matrixQR()
      .topRows(qr.cols())
      .triangularView<Eigen::Upper>()
      .transpose()
      .solve(b);
}

}  // namespace

BlockAngularQr::BlockAngularQr(int64_t num_shared_columns)
    : squared_lengths_(VectorXd::Zero(num_shared_columns)) {}

void BlockAngularQr::Append(const MatrixXd& own, std::vector<int64_t> columns,
                            const MatrixXd& shared) {
  Block block{Qr(own), std::move(columns), shared};
  if (shared.cols() > 0) {  // Eigen would move a null pointer
    block.shared.applyOnTheLeft(block.qr.householderQ().adjoint());
  }
  is_independent_ =
      is_independent_ &&
      AreIndependent(block.qr, own.colwise().squaredNorm().transpose());
  for (size_t c = 0; c < block.columns.size(); ++c) {
    squared_lengths_[block.columns[c]] +=
        shared.col(static_cast<int64_t>(c)).squaredNorm();
  }
  num_rest_ += block.num_rest();
  blocks_.push_back(std::move(block));
}

bool BlockAngularQr::Factorize() {
  if (!is_independent_ || num_rest_ < squared_lengths_.size()) return false;
  MatrixXd H = MatrixXd::Zero(num_rest_, squared_lengths_.size());
  int64_t begin = 0;
  for (const Block& block : blocks_) {
    const int64_t count = block.num_rest();
    for (size_t c = 0; c < block.columns.size(); ++c) {
      H.col(block.columns[c]).segment(begin, count) =
          block.shared.col(static_cast<int64_t>(c)).tail(count);
    }
    begin += count;
  }
  rest_.compute(H);
  return AreIndependent(rest_, squared_lengths_);
}

// With A = Q R, x = Q R^-T rhs.
VectorXd BlockAngularQr::SolveLeastNorm(const VectorXd& rhs) const {
  VectorXd own(rhs.size() - squared_lengths_.size());
  VectorXd shared = rhs.tail(squared_lengths_.size());
  int64_t begin = 0;
  for (const Block& block : blocks_) {
    const int64_t count = block.num_own();
    const VectorXd top = SolveTransposedR(block.qr, rhs.segment(begin, count));
    own.segment(begin, count) = top;
    for (size_t c = 0; c < block.columns.size(); ++c) {
      shared[block.columns[c]] -=
          block.shared.col(static_cast<int64_t>(c)).head(count).dot(top);
    }
    begin += count;
  }
  VectorXd rest = VectorXd::Zero(num_rest_);
  rest.head(shared.size()) = SolveTransposedR(rest_, shared);
  rest.applyOnTheLeft(rest_.householderQ());

  VectorXd x(own.size() + num_rest_);
  int64_t own_begin = 0;
  int64_t rest_begin = 0;
  for (const Block& block : blocks_) {
    VectorXd part(block.qr.rows());
    part << own.segment(own_begin, block.num_own()),
        rest.segment(rest_begin, block.num_rest());
    part.applyOnTheLeft(block.qr.householderQ());
    x.segment(own_begin + rest_begin, part.size()) = part;
    own_begin += block.num_own();
    rest_begin += block.num_rest();
  }
  return x;
}

std::vector<int64_t> LeastNormProblem::EquationsOfPoints() const {
  std::vector<int64_t> first(num_points);
  int64_t next = 0;
  for (int32_t k = 0; k < num_points; ++k) {
    first[k] = next;
    if (!IsFixedPoint(k)) next += 3;
  }
  return first;
}

bool LeastNormSolver::Factorize(LeastNormProblem problem) {
  problem_ = std::move(problem);
  by_points_.reset();
  if (problem_.num_rows() > 3 * static_cast<int64_t>(problem_.columns.size())) {
    return false;
  }
  return problem_.num_rows() <= max_dense_rows_ ? FactorizeDense()
                                                : FactorizeByPoints();
}

VectorXd LeastNormSolver::Solve(const VectorXd& rhs) const {
  return by_points_ ? SolveByPoints(rhs) : qr_->SolveLeastNorm(rhs);
}

// Appends the rows of M' of a point's observations.
void LeastNormSolver::AppendPoint(size_t begin, size_t end) {
  std::vector<int32_t> frames;
  for (size_t i = begin; i < end; ++i) {
    if (problem_.columns[i].frame > 0) {
      frames.push_back(problem_.columns[i].frame);
    }
  }
  std::sort(frames.begin(), frames.end());
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  std::vector<int64_t> columns;
  for (const int32_t f : frames) {
    for (int c = 0; c < 3; ++c) columns.push_back(3 * int64_t{f - 1} + c);
  }
  if (problem_.has_last_row) columns.push_back(3 * (problem_.num_frames - 1));

  const int64_t num_rows = 3 * static_cast<int64_t>(end - begin);
  const bool is_fixed = problem_.IsFixedPoint(problem_.columns[begin].point);
  MatrixXd own(num_rows, is_fixed ? 0 : 3);
  MatrixXd shared =
      MatrixXd::Zero(num_rows, static_cast<int64_t>(columns.size()));
  for (size_t i = begin; i < end; ++i) {
    const LeastNormProblem::Columns& c = problem_.columns[i];
    const int64_t row = 3 * static_cast<int64_t>(i - begin);
    if (!is_fixed) own.middleRows<3>(row) = c.rows;
    if (c.frame > 0) {
      const int64_t n =
          std::lower_bound(frames.begin(), frames.end(), c.frame) -
          frames.begin();
      shared.block<3, 3>(row, 3 * n) = -c.rows;
    }
    if (problem_.has_last_row) {
      shared.rightCols<1>().segment<3>(row) = c.last_row;
    }
  }
  qr_->Append(own, std::move(columns), shared);
}

bool LeastNormSolver::FactorizeDense() {
  qr_.emplace(3 * int64_t{problem_.num_frames - 1} + problem_.has_last_row);
  const size_t count = problem_.columns.size();
  int32_t num_points = 0;
  for (size_t begin = 0, end = 0; begin < count; begin = end) {
    const int32_t k = problem_.columns[begin].point;
    while (end < count && problem_.columns[end].point == k) ++end;
    AppendPoint(begin, end);
    if (!problem_.IsFixedPoint(k)) ++num_points;
  }
  return num_points == problem_.num_free_points() && qr_->Factorize();
}

// Factorises A'A for A = M', by eliminating the columns of points, so that
// SolveByPoints can compute A (A'A)^-1 rhs.
bool LeastNormSolver::FactorizeByPoints() {
  structure_ = {};
  structure_.point_begin.assign(1, 0);
  for (const LeastNormProblem::Columns& c : problem_.columns) {
    while (static_cast<int32_t>(structure_.point_begin.size()) <= c.point) {
      structure_.point_begin.push_back(
          static_cast<int64_t>(structure_.frame_of.size()));
    }
    structure_.frame_of.push_back(c.frame);
  }
  structure_.point_begin.resize(
      problem_.num_points + 1,
      static_cast<int64_t>(structure_.frame_of.size()));
  structure_.frame_is_fixed.assign(problem_.num_frames, 0);
  structure_.frame_is_fixed[0] = 1;
  structure_.point_is_fixed = problem_.point_is_fixed;
  by_points_ = std::make_unique<CentredLeastSquares<3>>(structure_,
                                                        Context{num_threads_});
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  for (size_t i = 0; i < problem_.columns.size(); ++i) {
    Eigen::Map<RowMajor>(by_points_->rows(static_cast<int64_t>(i))) =
        problem_.columns[i].rows;
  }
  if (!by_points_->Factorize()) return false;
  if (!problem_.has_last_row) return true;
  last_row_.resize(3 * static_cast<int64_t>(problem_.columns.size()));
  for (size_t i = 0; i < problem_.columns.size(); ++i) {
    last_row_.segment<3>(3 * static_cast<int64_t>(i)) =
        problem_.columns[i].last_row;
  }
  const double norm2 = last_row_.squaredNorm();
  BlockVector x;
  VectorXd in_span(last_row_.size());
  by_points_->SolveRefined(nullptr, last_row_.data(), &x, in_span.data());
  last_row_ -= in_span;
  last_row_norm2_ = last_row_.squaredNorm();
  return last_row_norm2_ > 1e-20 * norm2;  // else it depends on the others
}

VectorXd LeastNormSolver::SolveByPoints(const VectorXd& rhs) const {
  BlockVector g;
  g.SetZero(problem_.num_points, problem_.num_frames);
  const std::vector<int64_t> of_point = problem_.EquationsOfPoints();
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (!problem_.IsFixedPoint(k)) {
      g.points[k] = rhs.segment<3>(of_point[k]);
    }
  }
  const int64_t num_free_points = problem_.num_free_points();
  for (int32_t f = 1; f < problem_.num_frames; ++f) {
    g.frames[f] = rhs.segment<3>(3 * (num_free_points + f - 1));
  }
  BlockVector x;
  VectorXd solution(3 * static_cast<int64_t>(problem_.columns.size()));
  by_points_->SolveRefined(&g, nullptr, &x, solution.data());
  if (problem_.has_last_row) {
    double rest = rhs[rhs.size() - 1];
    for (size_t i = 0; i < problem_.columns.size(); ++i) {
      rest -= problem_.columns[i].last_row.dot(
          solution.segment<3>(3 * static_cast<int64_t>(i)));
    }
    solution += rest / last_row_norm2_ * last_row_;
  }
  return solution;
}

}  // namespace krot::internal
