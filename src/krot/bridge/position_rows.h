#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/bridge/bridge.h"
#include "krot/model/image_geometry.h"
#include "krot/proof/certificate_check.h"

namespace krot {

// That a camera's centre C is within r of a position g, as observations of the
// known rotation problem: a fixed point at g, seen by views of C's frame that
// are shifted by p, |p| > r. With a = p / |p| and a, m, n orthonormal,
//
//   w = a'(g + p - C),  v = (level / tan) (m n)'(g + p - C),  sin = r / |p|,
//
// has ||v|| / w <= level in the cone with its apex at g + p that touches the
// ball, so everywhere in the ball. Where the cones of several p touch it at C
// they are the ball to first order there, as the rows of observations are their
// lenses (docs/method.md, "Positions within a radius").

inline constexpr int kRowsPerPosition = 3;

// A row's cone is wider than the ball by this, relative: what rounding needs,
// and what the multipliers of a proof may be off.
inline constexpr double kPositionSlack = 1e-7;
// Inside of all cones is inside of the ball but for this, relative.
inline constexpr double kKeptPosition = 1e-6;

struct PositionRow {
  Eigen::Matrix3d E;
  Eigen::Vector3d shift;  // R_cw p, to be added to t_sr
};

// None for a p that is not fit: not finite, or |p| beside r out of range.
std::optional<PositionRow> MakePositionRow(
    const Eigen::Matrix3d& cam_from_world, double radius,
    const Eigen::Vector3d& apex, double level);

// Adds the positions of images that a problem has, but for those of fixed
// frames; their rows are taken as if every camera stood at its position.
void AddPositions(const std::vector<KnownPosition>& positions,
                  BuiltProblem* built);

// Which of built.positions a row belongs to.
inline int64_t PositionOf(const BuiltProblem& built, int64_t observation) {
  return (observation - static_cast<int64_t>(built.pixels.size())) /
         kRowsPerPosition;
}

// C - g.
Eigen::Vector3d OffsetOf(const BuiltProblem& built, const Estimate& estimate,
                         const BuiltPosition& position);

// p of the row, taken at an estimate: two of a position's cones touch its ball
// where that has the camera.
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

// The largest |C - g| / r; 0 without positions.
double LargestPositionRatio(const BuiltProblem& built,
                            const Estimate& estimate);

// Turns the multipliers of rows with built.position_level into those of rows
// whose level is the certificate's bound, which prove it.
void LevelPositions(const BuiltProblem& built, Certificate* certificate);

}  // namespace krot
