#include "krot/linear/schur_complement.h"

#include <algorithm>

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;
template <int kRows>
using Block =
    Eigen::Map<const Eigen::Matrix<double, kRows, 3, Eigen::RowMajor>>;
template <int kRows>
using Rows = Eigen::Map<const Eigen::Matrix<double, kRows, 1>>;

// Relative tolerance of the frames' solution before a refinement, which squares
// it.
constexpr double kToleranceBeforeRefinement = 1e-4;

}  // namespace

SchurComplement::SchurComplement(const BlockStructure& structure,
                                 const Context& context, Use use)
    : structure_(structure),
      // Waking another thread takes longer than its share of a small system.
      num_threads_(structure.num_observations() < 4000 ? 1
                                                       : context.num_threads),
      ranks_(context.ranks),
      reduced_(structure, ranks_, use),
      parts_(structure.point_begin, reduced_.num_parts(), ranks_),
      fine_parts_(structure.point_begin, 64) {}

bool SchurComplement::Factorize() {
  if (ranks_ == nullptr) return reduced_.Factorize(num_threads_);
  if (is_implicit()) {  // all ranks iterate, and need the diagonal
    if (ranks_->IsFirst()) reduced_.AddUpParts();
    std::vector<std::vector<double>>& parts = *reduced_.parts();
    ranks_->Broadcast(&parts[0]);
    for (size_t n = 1; n < parts.size(); ++n) {
      parts[n].assign(parts[0].size(), 0.0);
    }
    return reduced_.Factorize(num_threads_);
  }
  bool has_factor = !ranks_->IsFirst() || reduced_.Factorize(num_threads_);
  ranks_->Broadcast(&has_factor);
  return has_factor;
}

void SchurComplement::Share(VectorXd* numbers) const {
  if (ranks_ == nullptr) return;
  std::vector<double> shared(numbers->data(),
                             numbers->data() + numbers->size());
  ranks_->Broadcast(&shared);
  *numbers = VectorXd::Map(shared.data(), numbers->size());
}

void SchurComplement::SolveReduced(VectorXd rhs,
                                   const std::vector<Vector3d>* g_t,
                                   double tolerance, std::vector<Vector3d>* t,
                                   const AddProduct& add_product) {
  const auto add_g_t = [&] {
    for (size_t f = 0; g_t != nullptr && f < g_t->size(); ++f) {
      const int32_t column = reduced_.column(static_cast<int32_t>(f));
      if (column >= 0) rhs.segment<3>(column) += (*g_t)[f];
    }
  };
  VectorXd solution = VectorXd::Zero(rhs.size());
  if (is_implicit()) {
    add_g_t();
    Share(&rhs);
    solution = reduced_.Solve(rhs, tolerance, [&](const VectorXd& x) {
      VectorXd product = SumOverPoints(
          [&](int64_t k, int, double* y) { add_product(k, x.data(), y); });
      Share(&product);
      return product;
    });
  } else {
    if (ranks_ == nullptr || ranks_->IsFirst()) {
      add_g_t();
      solution = reduced_.Solve(rhs, tolerance);
    }
    Share(&solution);
  }
  t->assign(structure_.num_frames(), Vector3d::Zero());
  for (size_t f = 0; f < t->size(); ++f) {
    const int32_t column = reduced_.column(static_cast<int32_t>(f));
    if (column >= 0) (*t)[f] = solution.segment<3>(column);
  }
}

// The frames that see a point, and the matrices of their rows.
template <int kRows>
struct CentredLeastSquares<kRows>::Sightings {
  std::vector<int32_t> frames;  // free, ascending
  std::vector<Matrix3d> H;      // B_f'B_f of each
  std::vector<double> G[3];     // rows of [G_0 G_1 ...]
  Matrix3d fixed_G;             // sum over the fixed frames
  std::vector<char> is_high;    // per frame: its leverage is high
  std::vector<size_t> high;     // indices of the frames with high leverage

  Matrix3d FrameG(size_t f) const {
    Matrix3d block;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) block(r, c) = G[r][3 * f + c];
    }
    return block;
  }
};

template <int kRows>
CentredLeastSquares<kRows>::CentredLeastSquares(const BlockStructure& structure,
                                                const Context& context, Use use)
    : structure_(structure),
      schur_(structure, context, use),
      rows_(structure.num_observations() * kBlock),
      Q_(rows_.size()),
      R_(structure.num_points()),
      order_(OrderByFrame(structure)) {
  if (!schur_.is_implicit()) return;
  factors_.resize(structure.num_observations());
  num_factors_.resize(structure.num_points());
}

// Finds the sightings of point k. Sets its Q_ and R_, too.
template <int kRows>
void CentredLeastSquares<kRows>::FindSightings(int64_t k,
                                               Sightings* sightings) {
  Sightings& s = *sightings;
  const int64_t begin = structure_.point_begin[k];
  const int64_t m = structure_.point_begin[k + 1] - begin;
  s.frames.clear();
  s.H.clear();
  s.is_high.clear();
  s.high.clear();
  s.fixed_G.setZero();
  for (std::vector<double>& row : s.G) row.resize(3 * m);
  double* const own = Q_.data() + kBlock * begin;
  if (structure_.IsFixedPoint(k)) {
    std::fill_n(own, kBlock * m, 0.0);  // so that its solution is 0
  } else {
    std::copy_n(rows_.data() + kBlock * begin, kBlock * m, own);
  }
  R_[k] = Orthogonalize(kRows * m, own);
  for (int64_t n = begin; n < begin + m;) {
    const int32_t frame = structure_.frame_of[begin + order_[n]];
    Matrix3d G = Matrix3d::Zero(), H = Matrix3d::Zero();
    double leverage = 0;
    for (; n < begin + m && structure_.frame_of[begin + order_[n]] == frame;
         ++n) {
      const int64_t i = begin + order_[n];
      const Block<kRows> B(&rows_[kBlock * i]), Q(&Q_[kBlock * i]);
      G.noalias() += Q.transpose() * B;
      H.noalias() += B.transpose() * B;
      leverage += Q.squaredNorm();
    }
    if (schur_.reduced().column(frame) < 0) {
      s.fixed_G += G;
      continue;
    }
    const size_t f = s.frames.size();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) s.G[r][3 * f + c] = G(r, c);
    }
    s.frames.push_back(frame);
    s.H.push_back(H);
    s.is_high.push_back(leverage > 0.5);
    if (s.is_high.back()) s.high.push_back(f);
  }
}

template <int kRows>
void CentredLeastSquares<kRows>::AddPoint(int64_t k, int part) {
  thread_local Sightings s;
  FindSightings(k, &s);
  if (schur_.is_implicit()) return KeepFactors(k, part, s);
  ReducedCameraSystem& reduced = schur_.reduced();
  for (size_t f = 0; f < s.frames.size(); ++f) {
    if (s.is_high[f]) continue;
    reduced.AddBlock(part, s.frames[f], s.frames[f], s.H[f].data());
  }
  const double* const G[3] = {s.G[0].data(), s.G[1].data(), s.G[2].data()};
  reduced.SubtractSquare(part, s.frames, s.is_high, G);
  AddHighLeverage(part, s);
}

// Adds the blocks on the diagonal alone.
template <int kRows>
void CentredLeastSquares<kRows>::KeepFactors(int64_t k, int part,
                                             const Sightings& s) {
  Matrix3d sum = s.fixed_G;
  for (size_t f = 0; f < s.frames.size(); ++f) sum += s.FrameG(f);
  ReducedCameraSystem& reduced = schur_.reduced();
  FrameFactor* factor = &factors_[structure_.point_begin[k]];
  num_factors_[k] = static_cast<int32_t>(s.frames.size());
  for (size_t f = 0; f < s.frames.size(); ++f, ++factor) {
    const Matrix3d G = s.FrameG(f);
    Matrix3d others = sum - G;
    if (s.is_high[f]) {
      others = s.fixed_G;
      for (size_t g = 0; g < s.frames.size(); ++g) {
        if (g != f) others += s.FrameG(g);
      }
    }
    const Matrix3d block = G.transpose() * others;
    reduced.AddBlock(part, s.frames[f], s.frames[f], block.data());
    factor->column = reduced.column(s.frames[f]);
    std::copy_n(G.data(), 9, factor->G);
  }
}

template <int kRows>
void CentredLeastSquares<kRows>::AddProduct(int64_t k, const double* c,
                                            double* product) const {
  const FrameFactor* const begin = &factors_[structure_.point_begin[k]];
  const FrameFactor* const end = begin + num_factors_[k];
  Vector3d sum = Vector3d::Zero();
  for (const FrameFactor* factor = begin; factor != end; ++factor) {
    sum.noalias() +=
        Matrix3d::Map(factor->G) * Vector3d::Map(c + factor->column);
  }
  for (const FrameFactor* factor = begin; factor != end; ++factor) {
    const auto G = Matrix3d::Map(factor->G);
    const Vector3d others = sum - G * Vector3d::Map(c + factor->column);
    Vector3d::Map(product + factor->column).noalias() -= G.transpose() * others;
  }
}

template <int kRows>
void CentredLeastSquares<kRows>::AddHighLeverage(int part, const Sightings& s) {
  ReducedCameraSystem& reduced = schur_.reduced();
  for (const size_t a : s.high) {
    const Matrix3d G_a = s.FrameG(a);
    Matrix3d others = s.fixed_G;
    for (size_t f = 0; f < s.frames.size(); ++f) {
      if (f != a) others += s.FrameG(f);
    }
    const Matrix3d block = G_a.transpose() * others;
    reduced.AddBlock(part, s.frames[a], s.frames[a], block.data());
    for (const size_t b : s.high) {
      if (b >= a) break;
      const Matrix3d pair = -G_a.transpose() * s.FrameG(b);
      reduced.AddBlock(part, s.frames[a], s.frames[b], pair.data());
    }
  }
}

template <int kRows>
bool CentredLeastSquares<kRows>::Factorize() {
  schur_.AddPoints([&](int64_t k, int part) { AddPoint(k, part); });
  return schur_.Factorize();
}

// After the elimination the equations are
//
//   [ R  -sum G_f c_f ] [ s ]   [ top                  ]   top = Q'r + R^-T g_s
//   [ 0   S           ] [ c ] = [ g_t - B'(r - Q top)  ]
template <int kRows>
void CentredLeastSquares<kRows>::Solve(const BlockVector* g, const double* r,
                                       double tolerance, BlockVector* x,
                                       double* image) {
  x->points.resize(structure_.num_points());
  const auto reduce = [&](int64_t k, int, double* rhs) {
    const int64_t begin = structure_.point_begin[k];
    const int64_t end = structure_.point_begin[k + 1];
    Vector3d top = Vector3d::Zero();
    if (g != nullptr) top = R_[k].SolveTransposed(g->points[k]);
    for (int64_t i = begin; r != nullptr && i < end; ++i) {
      top.noalias() += Block<kRows>(&Q_[kBlock * i]).transpose() *
                       Rows<kRows>(r + kRows * i);
    }
    x->points[k] = top;
    for (int64_t i = begin; i < end; ++i) {
      const int32_t column = schur_.reduced().column(structure_.frame_of[i]);
      if (column < 0) continue;
      Eigen::Matrix<double, kRows, 1> rest =
          Block<kRows>(&Q_[kBlock * i]) * top;
      if (r != nullptr) rest -= Rows<kRows>(r + kRows * i);
      Vector3d::Map(rhs + column).noalias() +=
          Block<kRows>(&rows_[kBlock * i]).transpose() * rest;
    }
  };
  schur_.Solve(reduce, g == nullptr ? nullptr : &g->frames, tolerance,
               &x->frames, [this](int64_t k, const double* c, double* product) {
                 AddProduct(k, c, product);
               });
  schur_.ForEachPoint([&](int64_t k) {
    const int64_t begin = structure_.point_begin[k];
    const int64_t end = structure_.point_begin[k + 1];
    Vector3d top = x->points[k];
    for (int64_t i = begin; i < end; ++i) {
      const Eigen::Matrix<double, kRows, 1> moved =
          Block<kRows>(&rows_[kBlock * i]) * x->frames[structure_.frame_of[i]];
      top.noalias() += Block<kRows>(&Q_[kBlock * i]).transpose() * moved;
    }
    const Vector3d s = x->points[k] = R_[k].Solve(top);
    for (int64_t i = begin; image != nullptr && i < end; ++i) {
      Eigen::Matrix<double, kRows, 1>::Map(image + kRows * i).noalias() =
          Block<kRows>(&rows_[kBlock * i]) *
          (s - x->frames[structure_.frame_of[i]]);
    }
  });
}

template <int kRows>
void CentredLeastSquares<kRows>::SolveRefined(const BlockVector* g,
                                              const double* r, BlockVector* x,
                                              double* image) {
  const int64_t n = structure_.num_observations() * kRows;
  std::vector<double> rest(n);
  Solve(g, r, kToleranceBeforeRefinement, x, rest.data());
  for (int64_t i = 0; i < n; ++i) {
    rest[i] = (r != nullptr ? r[i] : 0) - rest[i];
  }
  BlockVector correction;
  Solve(g, rest.data(), kToleranceBeforeRefinement, &correction, nullptr);
  x->Add(1, correction);
  if (image != nullptr) Multiply(*x, image);
}

template <int kRows>
void CentredLeastSquares<kRows>::Multiply(const BlockVector& x,
                                          double* image) const {
  schur_.ForEachPoint([&](int64_t k) {
    for (int64_t i = structure_.point_begin[k];
         i < structure_.point_begin[k + 1]; ++i) {
      Eigen::Matrix<double, kRows, 1>::Map(image + kRows * i).noalias() =
          Block<kRows>(&rows_[kBlock * i]) *
          (x.points[k] - x.frames[structure_.frame_of[i]]);
    }
  });
}

template class CentredLeastSquares<3>;
template class CentredLeastSquares<4>;

}  // namespace krot::internal
