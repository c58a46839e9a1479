#include "krot/conic/point_elimination.h"

#include <algorithm>

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

// A frame all but determines a point beyond this |Q_a|^2: the more frames do,
// the more (I - Q Q') A_t are formed; the fewer, the more their blocks cancel.
constexpr double kHighLeverage = 0.5;
// |Q|^2 = 3 allows fewer, but for rounding.
constexpr int kMaxHighLeverage = 6;
// Of the frames' system's solutions: a refinement squares it.
constexpr double kTolerance = 1e-4;
// Waking a thread takes longer than its share of so few observations: with
// threads, certificates of small models took twice the time.
constexpr int64_t kFewObservations = 4000;

}  // namespace

template <int kRows>
PointElimination<kRows>::PointElimination(const BlockStructure& structure,
                                          int num_threads)
    : structure_(structure),
      num_threads_(
          structure.num_observations() < kFewObservations ? 1 : num_threads),
      frame_system_(structure),
      parts_(structure.point_begin, frame_system_.num_parts()),
      point_rows_(structure.num_observations() * kBlock),
      frame_rows_(structure.num_observations() * kBlock),
      Q_(structure.num_observations() * kBlock),
      R_(structure.num_points()),
      order_(OrderByFrame(structure)) {}

template <int kRows>
void PointElimination<kRows>::OrthogonalizePoint(int64_t k) {
  const int64_t begin = structure_.point_begin[k];
  const int64_t end = structure_.point_begin[k + 1];
  double* Q = Q_.data() + begin * kBlock;
  if (structure_.IsFixedPoint(k)) {
    std::fill(Q, Q + (end - begin) * kBlock, 0.0);  // all free: x is 0
  } else {
    std::copy(point_rows_.data() + begin * kBlock,
              point_rows_.data() + end * kBlock, Q);
  }
  R_[k] = Orthogonalize((end - begin) * kRows, Q);
}

// Collects the free frames that see a point, with G = Q'A_t.
template <int kRows>
void PointElimination<kRows>::FindSightings(int64_t k,
                                            Sightings* sightings) const {
  Sightings& s = *sightings;
  s.Clear();
  const int64_t begin = structure_.point_begin[k];
  const int64_t end = structure_.point_begin[k + 1];
  for (std::vector<double>& row : s.G) row.resize(3 * (end - begin));
  for (int64_t n = begin; n < end;) {
    const int32_t frame = structure_.frame_of[begin + order_[n]];
    const int64_t first = n;
    Matrix3d G = Matrix3d::Zero();
    double leverage = 0;
    for (; n < end && structure_.frame_of[begin + order_[n]] == frame; ++n) {
      const int64_t i = begin + order_[n];
      const ConstBlock<kRows> Q(&Q_[i * kBlock]);
      G.noalias() +=
          Q.transpose() * ConstBlock<kRows>(&frame_rows_[i * kBlock]);
      leverage += Q.squaredNorm();
    }
    if (frame_system_.column(frame) < 0) continue;
    const size_t column = 3 * s.frames.size();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) s.G[r][column + c] = G(r, c);
    }
    s.frames.push_back(frame);
    s.begin.push_back(first);
    s.end.push_back(n);
    s.is_high.push_back(leverage > kHighLeverage &&
                        static_cast<int>(s.high.size()) < kMaxHighLeverage);
    if (s.is_high.back()) s.high.push_back(s.frames.size() - 1);
  }
}

// Adds A_t'A_t - G'G, but for pairs of frames of high leverage. A frame may see
// it several times, and its rows must be summed before they are squared: moving
// frame and point together, they may all but cancel.
template <int kRows>
void PointElimination<kRows>::AddPointToFrameSystem(int64_t k, int part) {
  thread_local Sightings s;
  FindSightings(k, &s);
  const int64_t begin = structure_.point_begin[k];
  for (size_t a = 0; a < s.frames.size(); ++a) {
    if (s.is_high[a]) continue;
    Matrix3d block = Matrix3d::Zero();
    for (int64_t n = s.begin[a]; n < s.end[a]; ++n) {
      const ConstBlock<kRows> F(&frame_rows_[(begin + order_[n]) * kBlock]);
      block.noalias() += F.transpose() * F;
    }
    frame_system_.AddBlock(part, s.frames[a], s.frames[a], block.data());
  }
  const double* const G[3] = {s.G[0].data(), s.G[1].data(), s.G[2].data()};
  frame_system_.SubtractSquare(part, s.frames, s.is_high, G);
  if (!s.high.empty()) AddHighLeverage(k, part, s);
}

// P'P, P = (I - Q Q') A_t, for the frames of high leverage.
template <int kRows>
void PointElimination<kRows>::AddHighLeverage(int64_t k, int part,
                                              const Sightings& s) {
  const int64_t begin = structure_.point_begin[k];
  const int64_t m = structure_.point_begin[k + 1] - begin;
  const int num_high = static_cast<int>(s.high.size());
  thread_local std::vector<Block<kRows>> P;
  P.resize(m * num_high);
  for (int h = 0; h < num_high; ++h) {
    Matrix3d G;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) G(r, c) = s.G[r][3 * s.high[h] + c];
    }
    for (int64_t a = 0; a < m; ++a) {
      P[h * m + a].noalias() =
          -ConstBlock<kRows>(&Q_[(begin + a) * kBlock]) * G;
    }
    for (int64_t n = s.begin[s.high[h]]; n < s.end[s.high[h]]; ++n) {
      P[h * m + order_[n]] +=
          ConstBlock<kRows>(&frame_rows_[(begin + order_[n]) * kBlock]);
    }
  }
  for (int g = 0; g < num_high; ++g) {
    for (int h = 0; h <= g; ++h) {
      Matrix3d block = Matrix3d::Zero();
      for (int64_t a = 0; a < m; ++a) {
        block.noalias() += P[g * m + a].transpose() * P[h * m + a];
      }
      frame_system_.AddBlock(part, s.frames[s.high[g]], s.frames[s.high[h]],
                             block.data());
    }
  }
}

template <int kRows>
bool PointElimination<kRows>::Factorize() {
  frame_system_.SetZero();
  parts_.ForEach(num_threads_, [&](int64_t k, int part) {
    OrthogonalizePoint(k);
    AddPointToFrameSystem(k, part);
  });
  return frame_system_.Factorize(num_threads_);
}

template <int kRows>
void PointElimination<kRows>::Multiply(const BlockVector& x, double* y) const {
  parts_.ForEach(num_threads_, [&](int64_t k, int) {
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
  // What is left is [R G; 0 S] (s; t) = (top; g_t + A_t'(r - Q top)), where
  // top = Q'r + R^-T g_s.
  x->points.resize(structure_.num_points());
  x->frames.assign(structure_.num_frames(), Vector3d::Zero());
  parts_.ForEach(num_threads_, [&](int64_t k, int part) {
    const int64_t begin = structure_.point_begin[k];
    const int64_t end = structure_.point_begin[k + 1];
    Vector3d top = R_[k].SolveTransposed(g.points[k]);
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
  const VectorXd t = frame_system_.Solve(rhs[0], kTolerance);
  for (int64_t f = 0; f < structure_.num_frames(); ++f) {
    const int32_t column = frame_system_.column(static_cast<int32_t>(f));
    if (column >= 0) x->frames[f] = t.segment<3>(column);
  }
  // R s = top - G t.
  parts_.ForEach(num_threads_, [&](int64_t k, int) {
    Vector3d top = x->points[k];
    for (int64_t i = structure_.point_begin[k];
         i < structure_.point_begin[k + 1]; ++i) {
      top -= ConstBlock<kRows>(&Q_[i * kBlock]).transpose() *
             (ConstBlock<kRows>(&frame_rows_[i * kBlock]) *
              x->frames[structure_.frame_of[i]]);
    }
    x->points[k] = R_[k].Solve(top);
  });
}

template <int kRows>
void PointElimination<kRows>::Solve(const BlockVector& g, const double* r,
                                    BlockVector* x, int refinements) const {
  SolveOnce(g, r, x);
  if (refinements == 0) return;
  const int64_t n = structure_.num_observations() * kRows;
  std::vector<double> rest(n);
  BlockVector correction;
  for (int refinement = 0; refinement < refinements; ++refinement) {
    Multiply(*x, rest.data());
    for (int64_t i = 0; i < n; ++i) {
      rest[i] = (r != nullptr ? r[i] : 0) - rest[i];
    }
    SolveOnce(g, rest.data(), &correction);
    x->Add(1, correction);
  }
}

template class PointElimination<3>;
template class PointElimination<4>;

}  // namespace krot
