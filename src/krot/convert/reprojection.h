#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/camera/camera_model.h"
#include "krot/convert/build_problem.h"
#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// The condition that a camera's centre C is in an ellipsoid |U (C - g)| <= 1,
// written as observations of the known rotation problem: views of C's frame
// that are shifted by p, |U p| > 1, see a fixed point at g. With the unit
// vector a = U p / |U p| and a, m, n orthonormal,
//
//   w = a'U (g + p - C),  v = (level / tan) (m n)'U (g + p - C),
//   sin = 1 / |U p|,
//
// has ||v|| / w <= level exactly in the cone that touches the ellipsoid and has
// its apex at g + p; the cone contains the ellipsoid. If the cones of several p
// touch it at C, together they equal the ellipsoid to first order there, just
// as the rows of observations equal their lenses (docs/method/positions.md,
// "Positions within a radius").
//
// For a point X the shifted views belong to a fixed frame, and X + p - g takes
// the place of g + p - C.

inline constexpr int kRowsPerPosition = 3;

// A row's cone is wider than the region by this, relative. It covers rounding,
// and the change to the exact multipliers of a proof.
inline constexpr double kPositionSlack = 1e-7;
// A point inside all cones is inside the region up to this, relative.
inline constexpr double kKeptPosition = 1e-6;

// Adds the known positions of images and points that the problem has, except
// fixed ones. The rows are taken as if every camera and point were at the
// centre of its region.
void AddPositions(const std::vector<KnownPosition>& positions,
                  BuiltProblem* built);

// The number of a row among those of all positions.
inline int64_t RowIndex(const BuiltProblem& built, int64_t observation) {
  return built.problem.observations[observation].view -
         static_cast<int64_t>(built.image_of.size());
}
// The index in built.positions of the position that it belongs to.
inline int64_t PositionOf(const BuiltProblem& built, int64_t observation) {
  return RowIndex(built, observation) / kRowsPerPosition;
}

// The id of the image or 3D point whose position it is.
uint64_t IdOf(const Model& model, const BuiltProblem& built,
              const BuiltPosition& position);

// C - g, or g - X; the row sees p minus this.
Eigen::Vector3d OffsetOf(const BuiltProblem& built, const Estimate& estimate,
                         const BuiltPosition& position);

// p of the row, taken at an estimate: two of a position's three cones touch its
// region in the direction in which the camera or point is.
Eigen::Vector3d ApexAt(const BuiltProblem& built, const Estimate& estimate,
                       int64_t observation);

// p as AddPositions takes it.
Eigen::Vector3d ApexOfStart(const BuiltProblem& built, int64_t observation);

// Sets the row with this p in `problem`, which has the observations of
// built.problem; false if p cannot be used.
bool PutPositionRow(const BuiltProblem& built, int64_t observation,
                    const Eigen::Vector3d& apex, double level,
                    KnownRotationProblem* problem);

// Takes all position rows as AddPositions does, with another level.
void TakePositionRowsOfStart(double level, BuiltProblem* built);

// Takes all position rows at an estimate, with built.position_level.
void TakePositionRows(const BuiltProblem& built, const Estimate& estimate,
                      KnownRotationProblem* problem);

// The largest |U (C - g)|: at most 1 if every position is kept; 0 without
// positions.
double LargestPositionRatio(const BuiltProblem& built,
                            const Estimate& estimate);

// Changes multipliers for rows of built.position_level to multipliers for rows
// whose level is the certificate's bound, as a proof needs them. False if the
// bound is below built.position_level: then some y would be longer than lambda
// allows.
bool LevelPositions(const BuiltProblem& built, Certificate* certificate);

// The true residuals of a built problem, through the full cameras; its linear
// rows approximate them. The problem's Cost is that of the rows, TrueCost is
// what the user measures, and LevelledCost also counts how well positions are
// kept.
class Reprojection {
 public:
  // Keeps references.
  Reprojection(const Model& model, const BuiltProblem& built);

  // Whether no row depends on where it is taken, as for pinholes without known
  // positions: then Cost and TrueCost differ by rounding alone.
  bool IsLinear() const { return is_linear_; }

  // Whether observation i is one of the model; Error and SourceOf require that.
  bool IsOfModel(int64_t i) const { return built_.HasPixel(i); }

  // ||pi(x_cam) - pixel||_p over the scale of observation i, which is one of
  // the model, plus what the last digits of the coordinates may add. So an
  // estimate whose points are closer to a camera than its coordinates resolve
  // does not seem better than it is. Infinity if the point does not project,
  // for example because it is behind its camera.
  double Error(const Estimate& estimate, Norm norm, int64_t i) const;

  // The largest error, pixels; 0 without observations. O(observations); the
  // same bits at any number of threads.
  double TrueCost(const Estimate& estimate, Norm norm, int num_threads) const;

  // TrueCost or, if it is larger, the level of the positions times
  // LargestPositionRatio: the cost that all rows together stand for.
  double LevelledCost(const Estimate& estimate, Norm norm,
                      int num_threads) const;

  // Takes every row where its point projects at the estimate: the row is exact
  // there, and correct to first order around it. Likewise for known positions.
  // Returns whether all points project; a row whose point does not is
  // unchanged.
  bool TakeRows(const Estimate& estimate, int num_threads,
                KnownRotationProblem* problem) const;

  // The camera of observation i of the model.
  const Intrinsics& SourceOf(int64_t i) const {
    return sources_[built_.problem.observations[i].view];
  }

  // x_cam of observation i: its point in camera coordinates.
  Eigen::Vector3d InCamera(const Estimate& estimate, int64_t i) const;

 private:
  const BuiltProblem& built_;
  std::vector<Intrinsics> sources_;  // per view
  bool is_linear_;
};

// Takes rows that hold for all true errors up to `level` pixels: wherever the
// true error is at most `level`, the residual of the row is, too, over the rays
// of krot/camera/remainder_bound.h. The row is taken at the pixel's own ray and
// widened by what the lens bends there; for a pinhole by rounding alone. So
// what is proved for all residuals within the level is proved for all true
// errors within it.
//
// Returns for each observation whether it has such a row; if not, its row is
// unchanged. Requires level > 0 and p = 1, 2 or infinity. Some hundreds of
// microseconds for each.
std::vector<char> TakeOuterRows(const Model& model, const BuiltProblem& built,
                                Norm norm, double level, int num_threads,
                                KnownRotationProblem* problem);

}  // namespace krot::internal
