#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/linear/blocks.h"
#include "krot/linear/ordered_sums.h"
#include "krot/linear/reduced_camera_system.h"

namespace krot::internal {

// The common part of all eliminations of points. With the unknowns s of points
// and t of frames, the normal equations are
//
//   [ H_ss  H_st ] [ s ]   [ g_s ]
//   [ H_ts  H_tt ] [ t ] = [ g_t ]
//
// and H_ss consists of a 3x3 block for each point. Eliminating the points gives
// (H_tt - H_ts H_ss^-1 H_st) t = g_t - H_ts H_ss^-1 g_s: a reduced camera
// system, which is a sum over points. The same bits at any number of threads
// and of ranks that share the points; only the first rank has the system.
class SchurComplement {
 public:
  // Relative tolerance of solutions that are not refined afterwards.
  static constexpr double kTolerance = 1e-10;

  using Use = ReducedCameraSystem::Use;

  // Keeps a reference to `structure`.
  SchurComplement(const BlockStructure& structure, const Context& context,
                  Use use = Use::kManySolutions);

  // add(k, part) adds the contribution of point k to that part of reduced().
  template <typename Add>
  void AddPoints(const Add& add) {
    parts_.Sum(num_threads_, reduced_.num_numbers(), add, reduced_.parts());
  }
  // False if there is no factor even when it is regularised.
  bool Factorize();
  // Whether only the diagonal blocks of reduced() are formed.
  bool is_implicit() const {
    return reduced_.kind() == ReducedCameraSystem::Kind::kImplicit;
  }

  // add_product(k, x, y) adds to y the product of x with point k's contribution
  // to all blocks of reduced() but the diagonal ones.
  using AddProduct = std::function<void(int64_t k, const double* x, double* y)>;

  // Solves for the frames. reduce(k, part, rhs) adds the contribution of point
  // k to the right-hand side, which is indexed by the columns of reduced().
  // `g_t` is added unless it is null. The result is 0 for fixed frames.
  // `add_product` is needed if is_implicit().
  template <typename Reduce>
  void Solve(const Reduce& reduce, const std::vector<Eigen::Vector3d>* g_t,
             double tolerance, std::vector<Eigen::Vector3d>* t,
             const AddProduct& add_product = nullptr) {
    SolveReduced(SumOverPoints(reduce), g_t, tolerance, t, add_product);
  }

  // visit(k) for every point, on all threads.
  template <typename Visit>
  void ForEachPoint(const Visit& visit) const {
    fine_parts_.ForEach(num_threads_, [&](int64_t k, int) { visit(k); });
  }

  ReducedCameraSystem& reduced() { return reduced_; }
  const ReducedCameraSystem& reduced() const { return reduced_; }
  const BlockStructure& structure() const { return structure_; }

 private:
  // The sum of what add(k, part, sum) adds, on the first rank.
  template <typename Add>
  Eigen::VectorXd SumOverPoints(const Add& add) const {
    std::vector<std::vector<double>> parts;
    parts_.Sum(
        num_threads_, reduced_.num_columns(),
        [&](int64_t k, int part) { add(k, part, parts[part].data()); }, &parts);
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(reduced_.num_columns());
    if (ranks_ != nullptr && !ranks_->IsFirst()) return sum;
    for (const std::vector<double>& part : parts) {
      sum += Eigen::VectorXd::Map(part.data(), sum.size());
    }
    return sum;
  }
  // Replaces the numbers of all ranks by those of the first.
  void Share(Eigen::VectorXd* numbers) const;
  void SolveReduced(Eigen::VectorXd rhs,
                    const std::vector<Eigen::Vector3d>* g_t, double tolerance,
                    std::vector<Eigen::Vector3d>* t,
                    const AddProduct& add_product);

  const BlockStructure& structure_;
  const int num_threads_;
  Ranks* const ranks_;
  ReducedCameraSystem reduced_;
  const PointParts parts_;
  const PointParts fine_parts_;
};

// The linear systems of the known rotation problem. As rotations do not change,
// a row of point k and frame f depends only on the difference between the point
// and the frame's centre c_f:
//
//   H x = g + A'r,   H = A'A,   (A x)_i = B_i (s_k - c_f),   B_i kRows x 3.
//
//          points    frames
//          1 2 3     a b c
//        [ B        -B     ]   point 1, seen by a and b
//        [ B          -B   ]
//        [   B      -B     ]   point 2, seen by a, b and c
//   A =  [   B        -B   ]                           H_ss  0    0   | H_1t
//        [   B          -B ]                           0    H_ss  0   | H_2t
//        [     B      -B   ]   point 3,           H =  0     0   H_ss | H_3t
//        [     B        -B ]   by b and c              ---------------+-----
//                                                           .'        | H_tt
//
// Near an optimum the rows differ by ten orders of magnitude, so H_ss is never
// formed or inverted. With the QR factorisation B = Q R of a point's own rows,
// and G_f = Q'B of the rows of frame f, the point contributes to the reduced
// camera system
//
//   S_ff = B_f'B_f - G_f'G_f = G_f' sum_{g != f} G_g,   S_fg = -G_f'G_g.
//
// The difference cancels only where frame f all but determines the point,
// |Q_f|^2 > 1/2. As |Q|^2 = 3, there are fewer than six such frames; for them
// the sum is used, in which nothing cancels.
//
// If the reduced camera system is implicit, conjugate gradients need only
// products, (S c)_f = S_ff c_f - G_f' sum_{g != f} G_g c_g, and the blocks of
// two frames are not formed.
//
// Usage: fill rows; Factorize; then Solve and Multiply as often as necessary,
// until the rows are filled anew. Solutions have s_k = 0 and c_f = 0 for what
// is fixed, and 0 for unknowns of points that no row determines.
template <int kRows>  // per observation: 3 or 4
class CentredLeastSquares {
 public:
  using Use = ReducedCameraSystem::Use;

  // Keeps a reference to `structure`.
  CentredLeastSquares(const BlockStructure& structure, const Context& context,
                      Use use = Use::kManySolutions);

  double* rows(int64_t i) { return &rows_[i * kBlock]; }  // B_i, row-major

  // False if the reduced camera system has no factor even when regularised.
  bool Factorize();

  // x = H^-1 (g + A'r), to a relative error of `tolerance` in the energy norm.
  // r has kRows numbers per observation; g and r may be null for 0. If `image`
  // is not null it becomes A x; it may be r.
  void Solve(const BlockVector* g, const double* r, double tolerance,
             BlockVector* x, double* image);
  // The same with a step of iterative refinement, which removes the effect of
  // the regularisation.
  void SolveRefined(const BlockVector* g, const double* r, BlockVector* x,
                    double* image = nullptr);

  void Multiply(const BlockVector& x, double* image) const;  // A x

 private:
  static constexpr int kBlock = 3 * kRows;
  struct Sightings;
  // G_f of a free frame, by columns.
  struct FrameFactor {
    int32_t column;
    double G[9];
  };

  void FindSightings(int64_t k, Sightings* sightings);
  void AddPoint(int64_t k, int part);
  void KeepFactors(int64_t k, int part, const Sightings& sightings);
  void AddProduct(int64_t k, const double* c, double* product) const;
  void AddHighLeverage(int part, const Sightings& sightings);

  const BlockStructure& structure_;
  SchurComplement schur_;
  std::vector<double> rows_;
  std::vector<double> Q_;
  std::vector<UpperTriangle> R_;
  std::vector<int32_t> order_;  // of a point's observations by frame
  // If the system is implicit: the factors of point k begin at point_begin[k],
  // and how many there are.
  std::vector<FrameFactor> factors_;
  std::vector<int32_t> num_factors_;
};

}  // namespace krot::internal
