#pragma once

#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/linear/blocks.h"
#include "krot/linear/ordered_sums.h"
#include "krot/linear/reduced_camera_system.h"

namespace krot::internal {

// What every elimination of the points shares. With the unknowns of points s
// and of frames t, the normal equations are
//
//   [ H_ss  H_st ] [ s ]   [ g_s ]
//   [ H_ts  H_tt ] [ t ] = [ g_t ]
//
// and H_ss consists of a 3x3 block for each point. Without the points they are
// (H_tt - H_ts H_ss^-1 H_st) t = g_t - H_ts H_ss^-1 g_s: a reduced camera
// system, which is a sum over points. The same bits at any number of threads,
// and of ranks that share the points: the first rank has the system then.
class SchurComplement {
 public:
  // Of a solution whose error nothing takes away afterwards, relative.
  static constexpr double kTolerance = 1e-10;

  using Use = ReducedCameraSystem::Use;

  // Keeps a reference to `structure`.
  SchurComplement(const BlockStructure& structure, const Context& context,
                  Use use = Use::kManySolutions);

  // add(k, part) adds what is left of point k to that part of reduced().
  template <typename Add>
  void AddPoints(const Add& add) {
    parts_.Sum(num_threads_, reduced_.num_numbers(), add, reduced_.parts());
  }
  // False if there is no factor even when it is regularised.
  bool Factorize();
  // Whether reduced() is never formed, but for its blocks on the diagonal.
  bool is_implicit() const {
    return reduced_.kind() == ReducedCameraSystem::Kind::kImplicit;
  }

  // add_product(k, x, y) adds to y what all blocks of point k but those on the
  // diagonal are, times x. Numbers stand in the columns of reduced().
  using AddProduct = std::function<void(int64_t k, const double* x, double* y)>;

  // Solves for the frames. reduce(k, part, rhs) adds to the right-hand side
  // what is left of point k; `g_t`, if it is not null, is added to that. Fixed
  // frames are 0. `add_product` is needed if is_implicit().
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
  // Of what add(k, part, sum) adds; on the first rank.
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
  // All ranks get the first one's.
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

// The linear systems of the known rotation problem. Where rotations stay, a row
// knows a point k and a frame f only by how far the point is from the frame's
// centre c_f:
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
// formed or inverted. With B = Q R of a point's own rows and G_f = Q'B of those
// of frame f, the point leaves of the frames' blocks
//
//   S_ff = B_f'B_f - G_f'G_f = G_f' sum_{g != f} G_g,   S_fg = -G_f'G_g.
//
// The difference cancels only where frame f all but determines the point,
// |Q_f|^2 > 1/2. As |Q|^2 = 3, there are fewer than six such frames, and of
// them the sum is taken, in which nothing cancels.
//
// Where conjugate gradients need no more than products S c, blocks of two
// frames are not formed: (S c)_f = S_ff c_f - G_f' sum_{g != f} G_g c_g.
//
// Fill rows; Factorize; then Solve and Multiply as often as need be, until the
// rows are filled anew. What is fixed has s_k = 0 and c_f = 0, and so has a
// direction that no row tells.
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

  // x = H^-1 (g + A'r). r has kRows numbers per observation; g and r may be
  // null for 0. If `image` is not null it becomes A x; it may be r.
  void Solve(const BlockVector* g, const double* r, BlockVector* x,
             double* image = nullptr);
  // To a relative error in the energy norm.
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
  // G_f of a free frame.
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
  // If the system is implicit: those of point k from point_begin[k] on, and how
  // many.
  std::vector<FrameFactor> factors_;
  std::vector<int32_t> num_factors_;
};

}  // namespace krot::internal
