#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/analysis/model_comparison.h"
#include "krot/geometry.h"

namespace krot::internal {

// The robust similarity search behind FindPositionFrame (position_frame.h).

// In units of the median distance: one of a thousand Gaussian errors in three
// dimensions is farther off.
inline constexpr double kFarByMedian = 2.6;
inline constexpr int kMaxRefits = 20;

// A known position, and where the model places it. `pose.center1` is the
// position, relative to the median of all positions; `pose.center2` is the
// model's place, relative to the median of all places.
struct FramePair {
  size_t index = 0;
  PosePair pose;
  Eigen::Matrix3d unit_from_own = Eigen::Matrix3d::Identity();
};

std::vector<PosePair> PosesOf(const std::vector<FramePair>& pairs);

// The model's place, taken to the positions' frame, minus the position.
Eigen::Vector3d OffsetAt(const Similarity& own_from_model,
                         const FramePair& pair);

// Distances in radii, or in the positions' unit where radii are unknown.
std::vector<double> MisfitsOf(const std::vector<FramePair>& pairs,
                              const Similarity& own_from_model);

std::vector<FramePair> Within(const std::vector<FramePair>& pairs,
                              const std::vector<double>& misfits,
                              double tolerance);

// kFarByMedian times the misfit that a majority does not exceed.
double SpreadTolerance(const std::vector<double>& misfits);

// By consensus within the radii or, where these are unknown or no majority
// agrees, by the least median. None if all triples are on a line.
std::optional<Similarity> SearchFrame(const std::vector<FramePair>& pairs,
                                      bool has_radii);

}  // namespace krot::internal
