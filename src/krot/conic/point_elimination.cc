#include "krot/conic/point_elimination.h"

#include <algorithm>
#include <cmath>

#include "krot/base/check.h"
#include "krot/base/parallel_for.h"

namespace krot {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Relative to the rows of a point, and to the diagonal of the frames' system:
// what keeps factors of rank-deficient systems finite. Refinement removes the
// error it causes.
constexpr double kPointRegularization = 1e-12;
constexpr double kFrameRegularization = 1e-14;
constexpr double kLargestFrameRegularization = 1e-7;
constexpr int kRefinements = 1;

// The frames' system is summed in this many parts, whatever the number of
// threads, and the parts in order.
constexpr int64_t kParts = 2;
constexpr int64_t kPointsPerChunk = 128;

// Takes one of the columns of `rows` (stride 3, count n) and of the
// regularisation block into a Householder reflection I - tau v v', v_pivot
// implicit... The pivot is row k of the regularisation block.
}  // namespace

double BlockVector::Dot(const BlockVector& other) const {
  double sum = 0;
  for (size_t k = 0; k < points.size(); ++k)
    sum += points[k].dot(other.points[k]);
  for (size_t f = 0; f < frames.size(); ++f)
    sum += frames[f].dot(other.frames[f]);
  return sum;
}

void BlockVector::Add(double factor, const BlockVector& other) {
  for (size_t k = 0; k < points.size(); ++k)
    points[k] += factor * other.points[k];
  for (size_t f = 0; f < frames.size(); ++f)
    frames[f] += factor * other.frames[f];
}

PointElimination::PointElimination(const BlockStructure& structure,
                                   int num_threads)
    : structure_(structure),
      num_threads_(num_threads),
      rows_(structure.rows_per_observation),
      point_rows_(structure.num_observations() * rows_ * 3),
      frame_rows_(structure.num_observations() * rows_ * 3),
      reflectors_(structure.num_observations() * rows_ * 3),
      reflections_(structure.num_points()),
      column_of_frame_(structure.num_frames(), -1) {
  for (int64_t f = 0; f < structure.num_frames(); ++f) {
    if (structure.frame_is_fixed[f]) continue;
    column_of_frame_[f] = num_columns_;
    num_columns_ += 3;
  }
}

double* PointElimination::point_rows(int64_t observation) {
  return point_rows_.data() + observation * rows_ * 3;
}

double* PointElimination::frame_rows(int64_t observation) {
  return frame_rows_.data() + observation * rows_ * 3;
}

// Householder QR of the regularisation rows diag(rho) above the point's rows.
// The pivots lie in the regularisation rows, so that R takes their place.
void PointElimination::ReducePoint(int64_t k) {
  const int64_t begin = structure_.point_begin[k];
  const int64_t n = (structure_.point_begin[k + 1] - begin) * rows_;
  const double* source = point_rows_.data() + begin * rows_ * 3;
  double* V = reflectors_.data() + begin * rows_ * 3;
  std::copy(source, source + 3 * n, V);
  double largest = 0;
  for (int64_t i = 0; i < 3 * n; ++i)
    largest = std::max(largest, std::abs(V[i]));
  const double rho = kPointRegularization * largest;
  Reflections& reflections = reflections_[k];
  double T[3][3] = {{rho, 0, 0}, {0, rho, 0}, {0, 0, rho}};
  for (int c = 0; c < 3; ++c) {
    // Column c below (and with) the pivot T[c][c]; rows T[c+1..] are zero
    // there until they are mixed by earlier reflections: they never are, as
    // each reflection touches its own pivot row and the point's rows only.
    double norm2 = 0;
    for (int64_t i = 0; i < n; ++i) norm2 += V[3 * i + c] * V[3 * i + c];
    const double pivot = T[c][c];
    const double norm = std::sqrt(norm2 + pivot * pivot);
    if (!(norm2 > 0)) {
      reflections.tau[c] = 0;
      continue;
    }
    const double diagonal = pivot > 0 ? -norm : norm;
    const double v0 = pivot - diagonal;  // no cancellation
    const double tau = -v0 / diagonal;   // with v scaled to v0 = 1
    for (int64_t i = 0; i < n; ++i) V[3 * i + c] /= v0;
    reflections.tau[c] = tau;
    T[c][c] = diagonal;
    for (int d = c + 1; d < 3; ++d) {
      double dot = T[c][d];
      for (int64_t i = 0; i < n; ++i) dot += V[3 * i + c] * V[3 * i + d];
      dot *= tau;
      T[c][d] -= dot;
      for (int64_t i = 0; i < n; ++i) V[3 * i + d] -= dot * V[3 * i + c];
    }
  }
  reflections.R[0] = T[0][0];
  reflections.R[1] = T[0][1];
  reflections.R[2] = T[0][2];
  reflections.R[3] = T[1][1];
  reflections.R[4] = T[1][2];
  reflections.R[5] = T[2][2];
}

// (top; rows) <- Q' (top; rows), top the three pivot rows.
void PointElimination::ApplyQt(int64_t k, double* rows, double* top) const {
  const int64_t begin = structure_.point_begin[k];
  const int64_t n = (structure_.point_begin[k + 1] - begin) * rows_;
  const double* V = reflectors_.data() + begin * rows_ * 3;
  for (int c = 0; c < 3; ++c) {
    double dot = top[c];
    for (int64_t i = 0; i < n; ++i) dot += V[3 * i + c] * rows[i];
    dot *= reflections_[k].tau[c];
    top[c] -= dot;
    for (int64_t i = 0; i < n; ++i) rows[i] -= dot * V[3 * i + c];
  }
}

void PointElimination::ApplyQ(int64_t k, double* rows, double* top) const {
  const int64_t begin = structure_.point_begin[k];
  const int64_t n = (structure_.point_begin[k + 1] - begin) * rows_;
  const double* V = reflectors_.data() + begin * rows_ * 3;
  for (int c = 2; c >= 0; --c) {
    double dot = top[c];
    for (int64_t i = 0; i < n; ++i) dot += V[3 * i + c] * rows[i];
    dot *= reflections_[k].tau[c];
    top[c] -= dot;
    for (int64_t i = 0; i < n; ++i) rows[i] -= dot * V[3 * i + c];
  }
}

// What the reflections leave of the frames' columns, P = Q2'A_t, adds P'P.
void PointElimination::AddPointToFrameSystem(int64_t k, MatrixXd* scratch,
                                             MatrixXd* gram, MatrixXd* system) {
  const int64_t begin = structure_.point_begin[k];
  const int64_t m = structure_.point_begin[k + 1] - begin;
  MatrixXd& P = *scratch;
  P.setZero(m * rows_, 3 * m);
  for (int64_t a = 0; a < m; ++a) {
    const double* F = frame_rows_.data() + (begin + a) * rows_ * 3;
    for (int r = 0; r < rows_; ++r) {
      for (int c = 0; c < 3; ++c) P(a * rows_ + r, 3 * a + c) = F[3 * r + c];
    }
  }
  for (int64_t column = 0; column < 3 * m; ++column) {
    double top[3] = {0, 0, 0};
    ApplyQt(k, P.col(column).data(), top);
  }
  gram->setZero(3 * m, 3 * m);
  gram->selfadjointView<Eigen::Lower>().rankUpdate(P.transpose());
  gram->triangularView<Eigen::StrictlyUpper>() = gram->transpose();
  for (int64_t a = 0; a < m; ++a) {
    const int32_t row = column_of_frame_[structure_.frame_of[begin + a]];
    if (row < 0) continue;
    for (int64_t b = 0; b < m; ++b) {
      const int32_t column = column_of_frame_[structure_.frame_of[begin + b]];
      if (column < 0 || column > row) continue;
      system->block<3, 3>(row, column) += gram->block<3, 3>(3 * a, 3 * b);
    }
  }
}

bool PointElimination::Factorize() {
  const int64_t num_points = structure_.num_points();
  ParallelFor(num_points, kPointsPerChunk, num_threads_,
              [&](int64_t begin, int64_t end, int) {
                for (int64_t k = begin; k < end; ++k) ReducePoint(k);
              });
  std::vector<MatrixXd> systems(kParts);
  ParallelFor(kParts, 1, num_threads_, [&](int64_t part, int64_t, int) {
    MatrixXd scratch;
    MatrixXd gram;
    systems[part].setZero(num_columns_, num_columns_);
    for (int64_t k = part; k < num_points; k += kParts) {
      AddPointToFrameSystem(k, &scratch, &gram, &systems[part]);
    }
  });
  for (int64_t part = 1; part < kParts; ++part) systems[0] += systems[part];
  for (double regularization = kFrameRegularization;
       regularization < kLargestFrameRegularization; regularization *= 100) {
    MatrixXd regularized = systems[0];
    regularized.diagonal() *= 1 + regularization;
    regularized.diagonal().array() += std::numeric_limits<double>::min();
    frame_factor_.compute(regularized);
    if (frame_factor_.info() == Eigen::Success) return true;
  }
  return false;
}

void PointElimination::MultiplyRows(int64_t observation, const BlockVector& x,
                                    double* y) const {
  const double* S = point_rows_.data() + observation * rows_ * 3;
  const double* F = frame_rows_.data() + observation * rows_ * 3;
  const int64_t point =
      std::upper_bound(structure_.point_begin.begin(),
                       structure_.point_begin.end(), observation) -
      structure_.point_begin.begin() - 1;
  const Vector3d& s = x.points[point];
  const Vector3d& t = x.frames[structure_.frame_of[observation]];
  for (int r = 0; r < rows_; ++r) {
    y[r] = S[3 * r] * s[0] + S[3 * r + 1] * s[1] + S[3 * r + 2] * s[2] +
           F[3 * r] * t[0] + F[3 * r + 1] * t[1] + F[3 * r + 2] * t[2];
  }
}

void PointElimination::SolveOnce(const BlockVector& g, const double* r,
                                 BlockVector* x) const {
  x->SetZero(structure_.num_points(), structure_.num_frames());
  VectorXd rhs = VectorXd::Zero(num_columns_);
  for (int64_t f = 0; f < structure_.num_frames(); ++f) {
    if (column_of_frame_[f] >= 0) {
      rhs.segment<3>(column_of_frame_[f]) = g.frames[f];
    }
  }
  std::vector<double> rows;
  std::vector<Vector3d> tops(structure_.num_points());
  for (int64_t k = 0; k < structure_.num_points(); ++k) {
    const int64_t begin = structure_.point_begin[k];
    const int64_t m = structure_.point_begin[k + 1] - begin;
    rows.assign(m * rows_, 0.0);
    // top = R^-T g_k + Q1'r; the frames see r - Q1 (Q1'r + R^-T g_k).
    const double* R = reflections_[k].R;
    const Vector3d& gk = g.points[k];
    double y[3];
    y[0] = gk[0] / R[0];
    y[1] = (gk[1] - R[1] * y[0]) / R[3];
    y[2] = (gk[2] - R[2] * y[0] - R[4] * y[1]) / R[5];
    double top[3] = {0, 0, 0};
    if (r != nullptr) {
      std::copy(r + begin * rows_, r + (begin + m) * rows_, rows.begin());
      ApplyQt(k, rows.data(), top);
    }
    for (int c = 0; c < 3; ++c) {
      tops[k][c] = top[c] + y[c];
      top[c] = -y[c];
    }
    ApplyQ(k, rows.data(), top);
    for (int64_t a = 0; a < m; ++a) {
      const int32_t column = column_of_frame_[structure_.frame_of[begin + a]];
      if (column < 0) continue;
      const double* F = frame_rows_.data() + (begin + a) * rows_ * 3;
      for (int q = 0; q < rows_; ++q) {
        for (int c = 0; c < 3; ++c) {
          rhs[column + c] += F[3 * q + c] * rows[a * rows_ + q];
        }
      }
    }
  }
  const VectorXd t = frame_factor_.solve(rhs);
  for (int64_t f = 0; f < structure_.num_frames(); ++f) {
    if (column_of_frame_[f] >= 0) {
      x->frames[f] = t.segment<3>(column_of_frame_[f]);
    }
  }
  for (int64_t k = 0; k < structure_.num_points(); ++k) {
    const int64_t begin = structure_.point_begin[k];
    const int64_t m = structure_.point_begin[k + 1] - begin;
    rows.assign(m * rows_, 0.0);
    for (int64_t a = 0; a < m; ++a) {
      const Vector3d& ta = x->frames[structure_.frame_of[begin + a]];
      const double* F = frame_rows_.data() + (begin + a) * rows_ * 3;
      for (int q = 0; q < rows_; ++q) {
        rows[a * rows_ + q] =
            F[3 * q] * ta[0] + F[3 * q + 1] * ta[1] + F[3 * q + 2] * ta[2];
      }
    }
    double top[3] = {0, 0, 0};
    ApplyQt(k, rows.data(), top);
    const double* R = reflections_[k].R;
    double b[3];
    for (int c = 0; c < 3; ++c) b[c] = tops[k][c] - top[c];
    Vector3d& s = x->points[k];
    s[2] = b[2] / R[5];
    s[1] = (b[1] - R[4] * s[2]) / R[3];
    s[0] = (b[0] - R[1] * s[1] - R[2] * s[2]) / R[0];
  }
}

void PointElimination::Solve(const BlockVector& g, const double* r,
                             BlockVector* x) const {
  SolveOnce(g, r, x);
  const int64_t n = structure_.num_observations() * rows_;
  std::vector<double> rest(n);
  BlockVector correction;
  for (int refinement = 0; refinement < kRefinements; ++refinement) {
    for (int64_t i = 0; i < structure_.num_observations(); ++i) {
      MultiplyRows(i, *x, rest.data() + i * rows_);
      for (int q = 0; q < rows_; ++q) {
        double& value = rest[i * rows_ + q];
        value = (r != nullptr ? r[i * rows_ + q] : 0) - value;
      }
    }
    SolveOnce(g, rest.data(), &correction);
    x->Add(1, correction);
  }
}

}  // namespace krot
