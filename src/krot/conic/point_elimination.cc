#include "krot/conic/point_elimination.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/base/parallel_for.h"

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;
template <int kRows>
using Block = Eigen::Matrix<double, kRows, 3, Eigen::RowMajor>;
template <int kRows>
using ConstBlock = Eigen::Map<const Block<kRows>>;
template <int kRows>
using Rows = Eigen::Matrix<double, kRows, 1>;

// A column that keeps less than this of its norm is a combination of the
// ones before it: the point is free to move along it.
constexpr double kRankTolerance = 1e-13;
// An observation all but determines its point beyond this |Q_a|^2.
constexpr double kHighLeverage = 0.5;
constexpr int kMaxHighLeverage = 6;
constexpr int kRefinements = 1;
// Starting a thread takes longer than its share of so few observations.
constexpr int64_t kFewObservations = 4000;

// column -= q q'column; returns q'column. Done twice, Gram-Schmidt is as
// orthogonal as Householder's reflections [Giraud, Langou, Rozloznik 2005].
double Orthogonalize(const double* q, int64_t n, double* column) {
  double dot = 0;
  for (int64_t i = 0; i < n; ++i) dot += q[3 * i] * column[3 * i];
  for (int64_t i = 0; i < n; ++i) column[3 * i] -= dot * q[3 * i];
  return dot;
}

double ColumnNorm(const double* column, int64_t n) {
  double sum = 0;
  for (int64_t i = 0; i < n; ++i) sum += column[3 * i] * column[3 * i];
  return std::sqrt(sum);
}

}  // namespace

template <int kRows>
PointElimination<kRows>::PointElimination(const BlockStructure& structure,
                                          int num_threads)
    : structure_(structure),
      num_threads_(
          structure.num_observations() < kFewObservations ? 1 : num_threads),
      frame_system_(structure),
      point_rows_(structure.num_observations() * kBlock),
      frame_rows_(structure.num_observations() * kBlock),
      Q_(structure.num_observations() * kBlock),
      R_(structure.num_points()) {
  order_.reserve(structure.num_observations());
  for (int64_t k = 0; k < structure.num_points(); ++k) {
    const int64_t begin = structure.point_begin[k];
    const int64_t end = structure.point_begin[k + 1];
    for (int64_t i = begin; i < end; ++i) {
      order_.push_back(static_cast<int32_t>(i - begin));
    }
    std::sort(order_.begin() + begin, order_.end(), [&](int32_t a, int32_t b) {
      const int32_t frame_a = structure.frame_of[begin + a];
      const int32_t frame_b = structure.frame_of[begin + b];
      return frame_a != frame_b ? frame_a < frame_b : a < b;
    });
  }
  // Parts of about equal work, which grows with the square of the track.
  double total = 0;
  const auto work = [&](int64_t k) {
    const double m = static_cast<double>(structure.point_begin[k + 1] -
                                         structure.point_begin[k]);
    return m * (m + 10);
  };
  for (int64_t k = 0; k < structure.num_points(); ++k) total += work(k);
  const int num_parts = frame_system_.num_parts();
  part_begin_.assign(1, 0);
  double sum = 0;
  for (int64_t k = 0; k < structure.num_points(); ++k) {
    if (sum > total * static_cast<double>(part_begin_.size()) / num_parts) {
      part_begin_.push_back(k);
    }
    sum += work(k);
  }
  part_begin_.resize(num_parts + 1, structure.num_points());
}

template <int kRows>
void PointElimination<kRows>::ForPoints(
    const std::function<void(int64_t k, int part)>& body) const {
  ParallelFor(frame_system_.num_parts(), 1, num_threads_,
              [&](int64_t part, int64_t, int) {
                for (int64_t k = part_begin_[part]; k < part_begin_[part + 1];
                     ++k) {
                  body(k, static_cast<int>(part));
                }
              });
}

// A_s = Q R by Gram-Schmidt with reorthogonalisation.
template <int kRows>
void PointElimination<kRows>::OrthogonalizePoint(int64_t k) {
  const int64_t begin = structure_.point_begin[k];
  const int64_t n = (structure_.point_begin[k + 1] - begin) * kRows;
  const double* A = point_rows_.data() + begin * kBlock;
  double* Q = Q_.data() + begin * kBlock;
  std::copy(A, A + 3 * n, Q);
  double R[3][3] = {};
  for (int c = 0; c < 3; ++c) {
    const double norm_before = ColumnNorm(Q + c, n);
    for (int pass = 0; pass < 2; ++pass) {
      for (int b = 0; b < c; ++b) {
        R[b][c] += Orthogonalize(Q + b, n, Q + c);
      }
    }
    const double norm = ColumnNorm(Q + c, n);
    // Along a free direction the point does not answer.
    const bool is_free = !(norm > kRankTolerance * norm_before);
    R[c][c] = is_free ? std::numeric_limits<double>::infinity() : norm;
    const double scale = is_free ? 0 : 1 / norm;
    for (int64_t i = 0; i < n; ++i) Q[3 * i + c] *= scale;
  }
  R_[k] = {R[0][0], R[0][1], R[0][2], R[1][1], R[1][2], R[2][2]};
}

// Adds A_t' (I - Q Q') A_t, a 3x3 block for each pair of frames that see the
// point. A frame may see it several times, and its rows must be summed before
// they are squared: moving frame and point together, they may all but cancel.
template <int kRows>
void PointElimination<kRows>::AddPointToFrameSystem(int64_t k, int part) {
  const int64_t begin = structure_.point_begin[k];
  const int64_t end = structure_.point_begin[k + 1];
  const auto Q = [&](int64_t i) { return ConstBlock<kRows>(&Q_[i * kBlock]); };
  const auto F = [&](int64_t i) {
    return ConstBlock<kRows>(&frame_rows_[i * kBlock]);
  };
  thread_local std::vector<Sighting> sightings;
  sightings.clear();
  Sighting* high[kMaxHighLeverage];
  for (int64_t n = begin; n < end; ++n) {
    const int64_t i = begin + order_[n];
    const int32_t frame = structure_.frame_of[i];
    if (frame_system_.column(frame) < 0) continue;
    if (sightings.empty() || sightings.back().frame != frame) {
      sightings.push_back({frame, n, n, 0, Matrix3d::Zero(), false});
    }
    Sighting& sighting = sightings.back();
    sighting.end = n + 1;
    sighting.G += Q(i).transpose() * F(i);
    sighting.leverage += Q(i).squaredNorm();
  }
  int num_high = 0;
  for (Sighting& sighting : sightings) {
    sighting.is_high =
        sighting.leverage > kHighLeverage && num_high < kMaxHighLeverage;
    if (sighting.is_high) high[num_high++] = &sighting;
  }
  Matrix3d block;
  for (const Sighting& a : sightings) {
    if (!a.is_high) {
      block.noalias() = -a.G.transpose() * a.G;
      for (int64_t n = a.begin; n < a.end; ++n) {
        const int64_t i = begin + order_[n];
        block.noalias() += F(i).transpose() * F(i);
      }
      frame_system_.AddBlock(part, a.frame, a.frame, block.data());
    }
    for (const Sighting* b = sightings.data(); b != &a; ++b) {
      if (a.is_high && b->is_high) continue;
      block.noalias() = -a.G.transpose() * b->G;
      frame_system_.AddBlock(part, a.frame, b->frame, block.data());
    }
  }
  if (num_high == 0) return;
  // P = (I - Q Q') A_t for the frames of high leverage, over all rows.
  const int64_t m = end - begin;
  thread_local std::vector<Block<kRows>> P;
  P.resize(m * num_high);
  for (int h = 0; h < num_high; ++h) {
    for (int64_t a = 0; a < m; ++a) {
      P[h * m + a].noalias() = -Q(begin + a) * high[h]->G;
    }
    for (int64_t n = high[h]->begin; n < high[h]->end; ++n) {
      P[h * m + order_[n]] += F(begin + order_[n]);
    }
  }
  for (int g = 0; g < num_high; ++g) {
    for (int h = 0; h <= g; ++h) {
      block.setZero();
      for (int64_t a = 0; a < m; ++a) {
        block.noalias() += P[g * m + a].transpose() * P[h * m + a];
      }
      frame_system_.AddBlock(part, high[g]->frame, high[h]->frame,
                             block.data());
    }
  }
}

template <int kRows>
bool PointElimination<kRows>::Factorize() {
  frame_system_.SetZero();
  ForPoints([&](int64_t k, int part) {
    OrthogonalizePoint(k);
    AddPointToFrameSystem(k, part);
  });
  return frame_system_.Factorize(num_threads_);
}

template <int kRows>
void PointElimination<kRows>::Multiply(const BlockVector& x, double* y) const {
  ForPoints([&](int64_t k, int) {
    for (int64_t i = structure_.point_begin[k];
         i < structure_.point_begin[k + 1]; ++i) {
      Eigen::Map<Rows<kRows>>(y + i * kRows) =
          ConstBlock<kRows>(&point_rows_[i * kBlock]) * x.points[k] +
          ConstBlock<kRows>(&frame_rows_[i * kBlock]) *
              x.frames[structure_.frame_of[i]];
    }
  });
}

template <int kRows>
void PointElimination<kRows>::SolveOnce(const BlockVector& g, const double* r,
                                        BlockVector* x) const {
  const int num_parts = frame_system_.num_parts();
  std::vector<VectorXd> rhs(num_parts,
                            VectorXd::Zero(frame_system_.num_columns()));
  // top = Q'r + R^-T g; the frames see A_t'(r - Q top).
  x->points.resize(structure_.num_points());
  x->frames.assign(structure_.num_frames(), Vector3d::Zero());
  ForPoints([&](int64_t k, int part) {
    const int64_t begin = structure_.point_begin[k];
    const int64_t end = structure_.point_begin[k + 1];
    const UpperTriangle& R = R_[k];
    const Vector3d& gk = g.points[k];
    Vector3d top;
    top[0] = gk[0] / R.r00;
    top[1] = (gk[1] - R.r01 * top[0]) / R.r11;
    top[2] = (gk[2] - R.r02 * top[0] - R.r12 * top[1]) / R.r22;
    if (r != nullptr) {
      for (int64_t i = begin; i < end; ++i) {
        top += ConstBlock<kRows>(&Q_[i * kBlock]).transpose() *
               Eigen::Map<const Rows<kRows>>(r + i * kRows);
      }
    }
    x->points[k] = top;
    for (int64_t i = begin; i < end; ++i) {
      const int32_t column = frame_system_.column(structure_.frame_of[i]);
      if (column < 0) continue;
      Rows<kRows> rest = -ConstBlock<kRows>(&Q_[i * kBlock]) * top;
      if (r != nullptr) rest += Eigen::Map<const Rows<kRows>>(r + i * kRows);
      rhs[part].segment<3>(column) +=
          ConstBlock<kRows>(&frame_rows_[i * kBlock]).transpose() * rest;
    }
  });
  for (int part = 1; part < num_parts; ++part) rhs[0] += rhs[part];
  for (int64_t f = 0; f < structure_.num_frames(); ++f) {
    const int32_t column = frame_system_.column(static_cast<int32_t>(f));
    if (column >= 0) rhs[0].segment<3>(column) += g.frames[f];
  }
  const VectorXd t = frame_system_.Solve(rhs[0]);
  for (int64_t f = 0; f < structure_.num_frames(); ++f) {
    const int32_t column = frame_system_.column(static_cast<int32_t>(f));
    if (column >= 0) x->frames[f] = t.segment<3>(column);
  }
  ForPoints([&](int64_t k, int) {
    Vector3d& s = x->points[k];
    Vector3d top = s;
    for (int64_t i = structure_.point_begin[k];
         i < structure_.point_begin[k + 1]; ++i) {
      top -= ConstBlock<kRows>(&Q_[i * kBlock]).transpose() *
             (ConstBlock<kRows>(&frame_rows_[i * kBlock]) *
              x->frames[structure_.frame_of[i]]);
    }
    const UpperTriangle& R = R_[k];
    s[2] = top[2] / R.r22;
    s[1] = (top[1] - R.r12 * s[2]) / R.r11;
    s[0] = (top[0] - R.r01 * s[1] - R.r02 * s[2]) / R.r00;
  });
}

template <int kRows>
void PointElimination<kRows>::Solve(const BlockVector& g, const double* r,
                                    BlockVector* x) const {
  SolveOnce(g, r, x);
  const int64_t n = structure_.num_observations() * kRows;
  std::vector<double> rest(n);
  BlockVector correction;
  for (int refinement = 0; refinement < kRefinements; ++refinement) {
    Multiply(*x, rest.data());
    for (int64_t i = 0; i < n; ++i) {
      rest[i] = (r != nullptr ? r[i] : 0) - rest[i];
    }
    SolveOnce(g, rest.data(), &correction);
    x->Add(1, correction);
  }
}

template <int kRows>
int64_t PointElimination<kRows>::MemoryBytes() const {
  return frame_system_.MemoryBytes() +
         static_cast<int64_t>((3 * Q_.size()) * sizeof(double) +
                              R_.size() * sizeof(UpperTriangle));
}

template class PointElimination<3>;
template class PointElimination<4>;

}  // namespace krot
