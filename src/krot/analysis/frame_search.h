#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/analysis/model_comparison.h"
#include "krot/geometry.h"

namespace krot::internal {

// The robust similarity behind FindPositionFrame (position_frame.h).

// The distance that one of a thousand exceeds, by the median: of a Gaussian in
// three dimensions.
inline constexpr double kFarByMedian = 2.6;
inline constexpr int kMaxRefits = 20;

// A position of what the model places. `pose.center1` is the position, from the
// median of all, and `pose.center2` the model's place, likewise.
struct FramePair {
  size_t index = 0;
  PosePair pose;
  Eigen::Matrix3d unit_from_own = Eigen::Matrix3d::Identity();
};

std::vector<PosePair> PosesOf(const std::vector<FramePair>& pairs);

// What the model has there less the position.
Eigen::Vector3d OffsetAt(const Similarity& own_from_model,
                         const FramePair& pair);

// Distances by radii, or as they are where radii are unknown.
std::vector<double> MisfitsOf(const std::vector<FramePair>& pairs,
                              const Similarity& own_from_model);

std::vector<FramePair> Within(const std::vector<FramePair>& pairs,
                              const std::vector<double>& misfits,
                              double tolerance);

// kFarByMedian times the misfit that a majority does not exceed.
double SpreadTolerance(const std::vector<double>& misfits);

// By consensus or, where radii are unknown or no majority agrees to them, by
// the least median. None if all triples are on a line.
std::optional<Similarity> SearchFrame(const std::vector<FramePair>& pairs,
                                      bool has_radii);

}  // namespace krot::internal
