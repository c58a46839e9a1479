#include "krot/proof/dual_repair.h"

#include <utility>

namespace krot::internal {

using Eigen::VectorXd;

std::vector<int64_t> LeastNormProblem::EquationsOfPoints() const {
  std::vector<int64_t> first(num_points);
  int64_t next = 0;
  for (int32_t k = 0; k < num_points; ++k) {
    first[k] = next;
    if (!IsFixedPoint(k)) next += 3;
  }
  return first;
}

// Factorises A'A for A = M', by eliminating the columns of points, so that
// Solve can compute A (A'A)^-1 rhs.
bool LeastNormSolver::Factorize(LeastNormProblem problem) {
  problem_ = std::move(problem);
  if (problem_.num_rows() > 3 * static_cast<int64_t>(problem_.columns.size())) {
    return false;
  }
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
  equations_ = std::make_unique<CentredLeastSquares<3>>(structure_,
                                                        Context{num_threads_});
  using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  for (size_t i = 0; i < problem_.columns.size(); ++i) {
    Eigen::Map<RowMajor>(equations_->rows(static_cast<int64_t>(i))) =
        problem_.columns[i].rows;
  }
  if (!equations_->Factorize()) return false;
  if (!problem_.has_last_row) return true;
  last_row_.resize(3 * static_cast<int64_t>(problem_.columns.size()));
  for (size_t i = 0; i < problem_.columns.size(); ++i) {
    last_row_.segment<3>(3 * static_cast<int64_t>(i)) =
        problem_.columns[i].last_row;
  }
  const double norm2 = last_row_.squaredNorm();
  BlockVector x;
  VectorXd in_span(last_row_.size());
  equations_->SolveRefined(nullptr, last_row_.data(), &x, in_span.data());
  last_row_ -= in_span;
  last_row_norm2_ = last_row_.squaredNorm();
  return last_row_norm2_ > 1e-20 * norm2;  // else it depends on the others
}

VectorXd LeastNormSolver::Solve(const VectorXd& rhs) const {
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
  equations_->SolveRefined(&g, nullptr, &x, solution.data());
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
