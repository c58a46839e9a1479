#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Where to look for a small conflict of an observation: in a few frames of its
// track, among the points there whose rays miss each other by most.
class Neighbourhoods {
 public:
  // Keeps references. Cameras stand as in `estimate`.
  Neighbourhoods(const KnownRotationProblem& problem, const Estimate& estimate);

  // Sets of frames of the track of observation i, beside its own: pairs of the
  // most strained, for num_others = 2, or all. Only those of free observations.
  std::vector<std::vector<int32_t>> FrameSets(
      int64_t i, int num_others, const std::vector<char>& is_free) const;

  // Observation i, and in its frame and the others the free ones of its own
  // point and of the most strained that two of them see. Ascending.
  std::vector<int64_t> Around(int64_t i, std::vector<int32_t> frames,
                              const std::vector<char>& is_free) const;

 private:
  int32_t FrameOf(int64_t i) const {
    return problem_.views[problem_.observations[i].view].frame;
  }
  Eigen::Vector3d Direction(int64_t i) const;
  Eigen::Vector3d CentreOf(int64_t i) const;
  double Strain(int64_t i, int64_t j) const;
  void AddStrained(int32_t a, int32_t b, const std::vector<char>& is_free,
                   std::vector<int32_t>* points) const;

  const KnownRotationProblem& problem_;
  const Estimate& estimate_;
  std::vector<std::vector<int32_t>> points_of_frame_;  // ascending
};

}  // namespace krot::internal
