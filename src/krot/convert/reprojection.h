#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/convert/build_problem.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// That a camera's centre C is in an ellipsoid |U (C - g)| <= 1, as observations
// of the known rotation problem: a fixed point at g, seen by views of C's frame
// that are shifted by p, |U p| > 1. With a = U p / |U p| and a, m, n
// orthonormal,
//
//   w = a'U (g + p - C),  v = (level / tan) (m n)'U (g + p - C),
//   sin = 1 / |U p|,
//
// has ||v|| / w <= level in the cone with its apex at g + p that touches the
// ellipsoid, so everywhere in it. Where the cones of several p touch it at C
// they are the ellipsoid to first order there, as the rows of observations are
// their lenses (docs/method/positions.md, "Positions within a radius").
//
// That a point X is in one is seen from a fixed frame, by views that are
// shifted likewise: X + p - g takes the place of g + p - C.

inline constexpr int kRowsPerPosition = 3;

// A row's cone is wider than the region by this, relative: what rounding needs,
// and what the multipliers of a proof may be off.
inline constexpr double kPositionSlack = 1e-7;
// Inside of all cones is inside of the region but for this, relative.
inline constexpr double kKeptPosition = 1e-6;

// E of such a row, whose camera has axes of that rotation. None for a p that is
// not fit: not finite, or |U p| out of range.
std::optional<Eigen::Matrix3d> MakePositionRow(
    const Eigen::Matrix3d& cam_from_world,
    const Eigen::Matrix3d& unit_from_world, const Eigen::Vector3d& apex,
    double level);

// Adds the positions of images and points that a problem has, but for those
// that are fixed; their rows are taken as if everything were at its position.
void AddPositions(const std::vector<KnownPosition>& positions,
                  BuiltProblem* built);

// Which of all positions' rows a row is.
inline int64_t RowIndex(const BuiltProblem& built, int64_t observation) {
  return built.problem.observations[observation].view -
         static_cast<int64_t>(built.image_of.size());
}
// Which of built.positions it belongs to.
inline int64_t PositionOf(const BuiltProblem& built, int64_t observation) {
  return RowIndex(built, observation) / kRowsPerPosition;
}

// Of the image or 3D point whose position it is.
uint64_t IdOf(const Model& model, const BuiltProblem& built,
              const BuiltPosition& position);

// C - g, or g - X: what rows see of it is p less that.
Eigen::Vector3d OffsetOf(const BuiltProblem& built, const Estimate& estimate,
                         const BuiltPosition& position);

// p of the row, taken at an estimate: two of a position's cones touch its
// region where that has the camera or point.
Eigen::Vector3d ApexAt(const BuiltProblem& built, const Estimate& estimate,
                       int64_t observation);

// The same as AddPositions takes it.
Eigen::Vector3d ApexOfStart(const BuiltProblem& built, int64_t observation);

// Puts the row with this p into `problem`, which has built.problem's
// observations; false if p is not fit.
bool PutPositionRow(const BuiltProblem& built, int64_t observation,
                    const Eigen::Vector3d& apex, double level,
                    KnownRotationProblem* problem);

// Takes all of them as AddPositions does, with another level.
void TakePositionRowsOfStart(double level, BuiltProblem* built);

// Takes all of them at an estimate, with built.position_level.
void TakePositionRows(const BuiltProblem& built, const Estimate& estimate,
                      KnownRotationProblem* problem);

// The largest |U (C - g)|; 0 without positions.
double LargestPositionRatio(const BuiltProblem& built,
                            const Estimate& estimate);

// Turns the multipliers of rows with built.position_level into those of rows
// whose level is the certificate's bound, which prove it. False where a bound
// below built.position_level would take longer ones than there may be.
bool LevelPositions(const BuiltProblem& built, Certificate* certificate);

// The true residuals of a built problem, through the full cameras: what its
// linear rows stand for. The problem's Cost is that of the rows; TrueCost is
// what the user measures, and LevelledCost counts in how well positions are
// kept.
class Reprojection {
 public:
  // Keeps references.
  Reprojection(const Model& model, const BuiltProblem& built);

  // Whether no row depends on where it is taken, as for pinholes: then Cost and
  // TrueCost differ by rounding alone.
  bool IsLinear() const { return is_linear_; }

  // Whether observation i is one of the model: what Error and SourceOf are of.
  bool IsOfModel(int64_t i) const { return built_.HasPixel(i); }

  // ||pi(x_cam) - pixel||_p of observation i, which is one of the model, over
  // its scale, and
  // what the last digits of the coordinates may add to it: an estimate whose
  // points lie closer to a camera than its coordinates resolve is not as good
  // as it seems. Infinity where the point does not project, as behind its
  // camera.
  double Error(const Estimate& estimate, Norm norm, int64_t i) const;

  // The largest error, pixels; 0 without observations. O(observations); the
  // same bits at any number of threads.
  double TrueCost(const Estimate& estimate, Norm norm, int num_threads) const;

  // The same or, if that is more, the level of the positions times
  // LargestPositionRatio: what the rows are of, all of them.
  double LevelledCost(const Estimate& estimate, Norm norm,
                      int num_threads) const;

  // Takes every row where its point projects at the estimate: exact there, and
  // to first order around; likewise those of positions. Whether all do; a row
  // that does not stays.
  bool TakeRows(const Estimate& estimate, int num_threads,
                KnownRotationProblem* problem) const;

  // The camera of observation i of the model.
  struct Source {
    int model_id;
    const double* params;
  };
  const Source& SourceOf(int64_t i) const {
    return sources_[built_.problem.observations[i].view];
  }

  // x_cam of observation i.
  Eigen::Vector3d InCamera(const Estimate& estimate, int64_t i) const;

 private:
  double Resolution(const Estimate& estimate, int64_t i,
                    const Eigen::Vector3d& x_cam) const;

  const BuiltProblem& built_;
  std::vector<Source> sources_;  // per view
  bool is_linear_;
};

// Takes every row so that its residual is at most `level` pixels wherever the
// true error is, over the rays of krot/camera/remainder_bound.h: at the pixel's
// own bearing, and wider by what the lens bends there, or for a pinhole by what
// rounding does. What is proved of all estimates with residuals within the
// level is then proved of all with true errors within it.
//
// Whether an observation has such a row; without, the row stays. Requires level
// > 0 and p = 1, 2 or infinity. Some hundreds of microseconds for each.
std::vector<char> TakeOuterRows(const Model& model, const BuiltProblem& built,
                                Norm norm, double level, int num_threads,
                                KnownRotationProblem* problem);

}  // namespace krot::internal
