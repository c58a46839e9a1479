#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/conic/block_structure.h"
#include "krot/conic/frame_system.h"
#include "krot/conic/point_parts.h"
#include "krot/conic/thin_qr.h"

namespace krot {

// Least squares whose rows know a point k only as its frame f sees it, from
// that frame's centre:
//
//   min over s_k, c_f   sum_i | B_i (s_k - c_f) - r_i |^2,   B_i 3 x 3,
//
// the structure of PointElimination for frames that move but do not turn, with
// half of its columns. With B = Q R of a point's own rows, G_f = Q'B of those
// of frame f, its part of the frames' system is a Laplacian,
//
//   S_ff = G_f' sum_{g != f} G_g,   S_fg = -G_f'G_g,
//
// in which nothing cancels, however a frame's rows compare with the others'.
//
// Fill rows; Factorize; then Solve as often as need be, until the rows are
// filled anew.
class CentreElimination {
 public:
  // Keeps a reference to `structure`, of which what is fixed has c_f = 0, s =
  // 0.
  // Where ranks share the points they make one each, of their shares.
  CentreElimination(const BlockStructure& structure, const Context& context);

  // B_i, row-major.
  double* rows(int64_t i) { return &rows_[i * 9]; }

  // False if the frames' system has no Cholesky factor even when regularised.
  bool Factorize();

  // `r`, three numbers an observation, becomes B_i (s_k - c_f). A direction
  // that no row tells stays 0.
  void Solve(double* r, BlockVector* x) const;

  // What an elimination of this structure occupies.
  static int64_t MemoryBytes(const BlockStructure& structure);

 private:
  struct Sightings;

  void FindSightings(int64_t k, Sightings* sightings);
  void AddPointToFrameSystem(int64_t k, int part);
  template <typename Add>
  bool FactorizeOnFirst(const Add& add);
  Eigen::VectorXd SolveFrames(const Eigen::VectorXd& rhs) const;
  void AddHighLeverage(int part, const Sightings& sightings);
  void ReducePoint(int64_t k, const double* r, Eigen::Vector3d* top,
                   Eigen::VectorXd* rhs) const;
  void BackSubstitute(int64_t k, double* r, BlockVector* x) const;

  const BlockStructure& structure_;
  const int num_threads_;
  Ranks* const ranks_;
  FrameSystem frame_system_;
  const PointParts parts_;  // of the frame system's sum
  const PointParts fine_parts_;
  std::vector<double> rows_;  // B
  std::vector<double> Q_;
  std::vector<UpperTriangle> R_;
  std::vector<int32_t> order_;  // of a point's observations by frame
};

}  // namespace krot
