#include "krot/finish/centre_elimination.h"

#include <algorithm>

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Rows = Eigen::Map<const RowMatrix3>;

// Beyond this |Q_f|^2 of a frame, B_f'B_f and G_f'G_f all but cancel.
constexpr double kHighLeverage = 0.5;
// As |Q|^2 = 3, fewer have it, but for rounding.
constexpr size_t kMaxHighLeverage = 6;
// Parts of the loops that add up nothing.
constexpr int kFineParts = 64;
// Waking a thread takes longer than its share of so few observations.
constexpr int64_t kFewObservations = 4000;

}  // namespace

// The frames that see a point, and what they see of it.
struct CentreElimination::Sightings {
  std::vector<int32_t> frames;  // free, ascending
  std::vector<Matrix3d> H;      // B_f'B_f of each
  std::vector<double> G[3];     // rows of [G_0 G_1 ...]
  Matrix3d fixed_G;             // of fixed frames together
  std::vector<char> is_high;    // whose leverage is
  std::vector<size_t> high;     // those

  Matrix3d FrameG(size_t f) const {
    Matrix3d block;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) block(r, c) = G[r][3 * f + c];
    }
    return block;
  }
};

CentreElimination::CentreElimination(const BlockStructure& structure,
                                     const Context& context)
    : structure_(structure),
      num_threads_(structure.num_observations() < kFewObservations
                       ? 1
                       : context.num_threads),
      ranks_(context.ranks),
      frame_system_(structure, ranks_),
      parts_(structure.point_begin, frame_system_.num_parts(), ranks_),
      fine_parts_(structure.point_begin, kFineParts),
      rows_(structure.num_observations() * 9),
      Q_(rows_.size()),
      R_(structure.num_points()),
      order_(OrderByFrame(structure)) {}

// Sets Q and R, too.
void CentreElimination::FindSightings(int64_t k, Sightings* sightings) {
  Sightings& s = *sightings;
  const int64_t begin = structure_.point_begin[k];
  const int64_t m = structure_.point_begin[k + 1] - begin;
  s.frames.clear();
  s.H.clear();
  s.is_high.clear();
  s.high.clear();
  s.fixed_G.setZero();
  for (std::vector<double>& row : s.G) row.resize(3 * m);
  if (structure_.IsFixedPoint(k)) {
    std::fill_n(Q_.data() + 9 * begin, 9 * m, 0.0);  // all free: s is 0
  } else {
    std::copy_n(rows_.data() + 9 * begin, 9 * m, Q_.data() + 9 * begin);
  }
  R_[k] = Orthogonalize(3 * m, Q_.data() + 9 * begin);
  for (int64_t n = begin; n < begin + m;) {
    const int32_t frame = structure_.frame_of[begin + order_[n]];
    Matrix3d G = Matrix3d::Zero(), H = Matrix3d::Zero();
    double leverage = 0;
    for (; n < begin + m && structure_.frame_of[begin + order_[n]] == frame;
         ++n) {
      const int64_t i = begin + order_[n];
      const Rows B(&rows_[9 * i]), Q(&Q_[9 * i]);
      G.noalias() += Q.transpose() * B;
      H.noalias() += B.transpose() * B;
      leverage += Q.squaredNorm();
    }
    if (frame_system_.column(frame) < 0) {
      s.fixed_G += G;
      continue;
    }
    const size_t f = s.frames.size();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) s.G[r][3 * f + c] = G(r, c);
    }
    s.frames.push_back(frame);
    s.H.push_back(H);
    s.is_high.push_back(leverage > kHighLeverage &&
                        s.high.size() < kMaxHighLeverage);
    if (s.is_high.back()) s.high.push_back(f);
  }
}

// Of a frame of low leverage B_f'B_f - G_f'G_f is as good.
void CentreElimination::AddPointToFrameSystem(int64_t k, int part) {
  thread_local Sightings s;
  FindSightings(k, &s);
  for (size_t f = 0; f < s.frames.size(); ++f) {
    if (s.is_high[f]) continue;
    frame_system_.AddBlock(part, s.frames[f], s.frames[f], s.H[f].data());
  }
  const double* const G[3] = {s.G[0].data(), s.G[1].data(), s.G[2].data()};
  frame_system_.SubtractSquare(part, s.frames, s.is_high, G);
  AddHighLeverage(part, s);
}

void CentreElimination::AddHighLeverage(int part, const Sightings& s) {
  for (const size_t a : s.high) {
    const Matrix3d G_a = s.FrameG(a);
    Matrix3d others = s.fixed_G;
    for (size_t f = 0; f < s.frames.size(); ++f) {
      if (f != a) others += s.FrameG(f);
    }
    const Matrix3d block = G_a.transpose() * others;
    frame_system_.AddBlock(part, s.frames[a], s.frames[a], block.data());
    for (const size_t b : s.high) {
      if (b >= a) break;
      const Matrix3d pair = -G_a.transpose() * s.FrameG(b);
      frame_system_.AddBlock(part, s.frames[a], s.frames[b], pair.data());
    }
  }
}

bool CentreElimination::Factorize() {
  const auto add = [&](int64_t k, int part) { AddPointToFrameSystem(k, part); };
  if (ranks_ != nullptr) return FactorizeOnFirst(add);
  frame_system_.SetZero();
  parts_.ForEach(num_threads_, add);
  return frame_system_.Factorize(num_threads_);
}

// The system is the first rank's.
template <typename Add>
bool CentreElimination::FactorizeOnFirst(const Add& add) {
  for (int part = 0; part < frame_system_.num_parts(); ++part) {
    if (ranks_->IsFirst() || parts_.HasPoints(part)) {
      frame_system_.SetZero(part);
    }
  }
  parts_.SumOverRanks(
      num_threads_, add, [&](int part) { return frame_system_.Part(part); },
      [&](int part, const std::vector<double>& numbers) {
        frame_system_.SetPart(part, numbers);
      });
  bool has_factor = !ranks_->IsFirst() || frame_system_.Factorize(num_threads_);
  ranks_->Broadcast(&has_factor);
  return has_factor;
}

// top = Q'r; the frames' right-hand side loses B'(r - Q top).
void CentreElimination::ReducePoint(int64_t k, const double* r, Vector3d* top,
                                    VectorXd* rhs) const {
  const int64_t begin = structure_.point_begin[k];
  const int64_t end = structure_.point_begin[k + 1];
  Vector3d sum = Vector3d::Zero();
  for (int64_t i = begin; i < end; ++i) {
    sum.noalias() +=
        Rows(&Q_[9 * i]).transpose() * Eigen::Map<const Vector3d>(r + 3 * i);
  }
  *top = sum;
  for (int64_t i = begin; i < end; ++i) {
    const int32_t column = frame_system_.column(structure_.frame_of[i]);
    if (column < 0) continue;
    const Vector3d rest =
        Rows(&Q_[9 * i]) * sum - Eigen::Map<const Vector3d>(r + 3 * i);
    rhs->segment<3>(column).noalias() += Rows(&rows_[9 * i]).transpose() * rest;
  }
}

// R s = top + sum Q'B c.
void CentreElimination::BackSubstitute(int64_t k, double* r,
                                       BlockVector* x) const {
  const int64_t begin = structure_.point_begin[k];
  const int64_t end = structure_.point_begin[k + 1];
  Vector3d top = x->points[k];
  for (int64_t i = begin; i < end; ++i) {
    const Vector3d moved =
        Rows(&rows_[9 * i]) * x->frames[structure_.frame_of[i]];
    top.noalias() += Rows(&Q_[9 * i]).transpose() * moved;
  }
  const Vector3d s = x->points[k] = R_[k].Solve(top);
  for (int64_t i = begin; i < end; ++i) {
    Eigen::Map<Vector3d>(r + 3 * i).noalias() =
        Rows(&rows_[9 * i]) * (s - x->frames[structure_.frame_of[i]]);
  }
}

VectorXd CentreElimination::SolveFrames(const VectorXd& rhs) const {
  if (ranks_ == nullptr) return frame_system_.Solve(rhs);
  std::vector<double> solution(rhs.size());
  if (ranks_->IsFirst()) {
    VectorXd::Map(solution.data(), rhs.size()) = frame_system_.Solve(rhs);
  }
  ranks_->Broadcast(&solution);
  return VectorXd::Map(solution.data(), rhs.size());
}

void CentreElimination::Solve(double* r, BlockVector* x) const {
  const int num_parts = frame_system_.num_parts();
  std::vector<VectorXd> rhs(num_parts,
                            VectorXd::Zero(frame_system_.num_columns()));
  x->points.resize(structure_.num_points());
  x->frames.assign(structure_.num_frames(), Vector3d::Zero());
  const auto reduce = [&](int64_t k, int part) {
    ReducePoint(k, r, &x->points[k], &rhs[part]);
  };
  if (ranks_ == nullptr) {
    parts_.ForEach(num_threads_, reduce);
  } else {
    parts_.SumOverRanks(
        num_threads_, reduce,
        [&](int part) {
          return std::vector<double>(rhs[part].begin(), rhs[part].end());
        },
        [&](int part, const std::vector<double>& numbers) {
          rhs[part] = VectorXd::Map(numbers.data(), rhs[part].size());
        });
  }
  for (int part = 1; part < num_parts; ++part) rhs[0] += rhs[part];
  const VectorXd c = SolveFrames(rhs[0]);
  for (int64_t f = 0; f < structure_.num_frames(); ++f) {
    const int32_t column = frame_system_.column(static_cast<int32_t>(f));
    if (column >= 0) x->frames[f] = c.segment<3>(column);
  }
  fine_parts_.ForEach(num_threads_,
                      [&](int64_t k, int) { BackSubstitute(k, r, x); });
}

int64_t CentreElimination::MemoryBytes(const BlockStructure& structure) {
  constexpr int64_t kPerObservation = 18 * sizeof(double) + sizeof(int32_t);
  return structure.num_observations() * kPerObservation +
         structure.num_points() * int64_t{sizeof(UpperTriangle)} +
         FrameSystem(structure).MemoryBytes();
}

}  // namespace krot
