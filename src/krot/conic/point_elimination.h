#pragma once

#include <cstdint>
#include <vector>

#include "krot/conic/block_structure.h"
#include "krot/conic/frame_system.h"
#include "krot/conic/point_parts.h"
#include "krot/conic/thin_qr.h"

namespace krot {

// The linear systems of the interior point,
//
//   H x = g + A'r,   H = A'A,   A = [A_s  A_t],
//
// with the structure of bundle adjustment: every observation has kRows rows,
// with 3 columns for its point and 3 for its frame.
//
//          points    frames
//          1 2 3     a b c
//        [ #         #     ]   point 1, seen by a and b
//        [ #           #   ]
//        [   #       #     ]   point 2, seen by a, b and c
//   A =  [   #         #   ]                           H_ss  0    0   | H_1t
//        [   #           # ]                           0    H_ss  0   | H_2t
//        [     #       #   ]   point 3,           H =  0     0   H_ss | H_3t
//        [     #         # ]   by b and c              ---------------+-----
//           A_s       A_t                                    .'       | H_tt
//
// is solved by eliminating the points. Near an optimum the rows differ by ten
// orders of magnitude, so H and its 3x3 blocks are never formed or inverted:
// with A_s = Q R of a point's own rows, its part of the frames' system is
//
//   A_t' (I - Q Q') A_t = A_t'A_t - G'G,   G = Q'A_t = [G_a G_b ...],
//
// with a 3x3 block for every pair of frames that see it: -G_a'G_b of two
// frames, F_a'F_a - G_a'G_a of one. These cancel only where a frame all but
// determines the point, |Q_a|^2 > 1/2. As |Q|^2 = 3, these are fewer than six,
// and there (I - Q Q') A_t is formed first.
//
// A fixed point has no columns: its part of A_s counts as 0, and its part of x
// is 0.
//
// Fill point_rows and frame_rows; Factorize; then Solve and Multiply as often
// as need be, until the rows are filled anew.
template <int kRows>  // per observation: 3 or 4
class PointElimination {
 public:
  // Keeps a reference to `structure`.
  PointElimination(const BlockStructure& structure, int num_threads);

  // Row-major blocks of A, kRows x 3 for each observation.
  double* point_rows(int64_t i) { return &point_rows_[i * kBlock]; }
  double* frame_rows(int64_t i) { return &frame_rows_[i * kBlock]; }

  // False if the frames' system has no Cholesky factor even when regularised.
  bool Factorize();

  // x = H^-1 (g + A'r); r holds kRows numbers per observation, or is null for
  // 0. A refinement takes the effect of the frames' regularisation away; each
  // is another solve.
  void Solve(const BlockVector& g, const double* r, BlockVector* x,
             int refinements = 1) const;

  // y = A x, laid out like r.
  void Multiply(const BlockVector& x, double* y) const;

 private:
  static constexpr int kBlock = 3 * kRows;

  // The free frames that see a point, in one observation or more.
  struct Sightings {
    std::vector<int32_t> frames;      // ascending
    std::vector<int64_t> begin, end;  // of order_, per frame
    std::vector<char> is_high;        // per frame: its leverage is
    std::vector<size_t> high;         // the frames of which it is
    std::vector<double> G[3];         // the rows of Q'A_t

    void Clear() {
      frames.clear();
      begin.clear();
      end.clear();
      is_high.clear();
      high.clear();
    }
  };

  void OrthogonalizePoint(int64_t k);
  void FindSightings(int64_t k, Sightings* sightings) const;
  void AddPointToFrameSystem(int64_t k, int part);
  void AddHighLeverage(int64_t k, int part, const Sightings& sightings);
  void SolveOnce(const BlockVector& g, const double* r, BlockVector* x) const;

  const BlockStructure& structure_;
  const int num_threads_;
  FrameSystem frame_system_;
  const PointParts parts_;
  std::vector<double> point_rows_;  // A_s
  std::vector<double> frame_rows_;  // A_t
  std::vector<double> Q_;
  std::vector<UpperTriangle> R_;
  std::vector<int32_t> order_;  // of a point's observations by frame
};

}  // namespace krot
