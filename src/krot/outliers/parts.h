#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The frame of observation i.
inline int32_t FrameOf(const KnownRotationProblem& problem, int64_t i) {
  return problem.views[problem.observations[i].view].frame;
}

// Two groups of frames that share tracks.
struct GroupPair {
  int32_t a = -1, b = -1;
  double strength = 0;  // how many tracks both see, or their share
};

// Groups of frames, and what they see of the tracks.
class Groups {
 public:
  Groups(const KnownRotationProblem& problem, std::vector<int32_t> group_of)
      : problem_(problem), group_of_(std::move(group_of)) {}

  // Every two groups that share tracks.
  std::vector<GroupPair> Pairs() const;
  // Per group: the tracks that two of its frames see or, if it is one, this
  // one, in all and of these those that others see, too: two others at least,
  // if the scales are to be compared.
  struct Count {
    int64_t num_tracks = 0;
    int64_t num_shared = 0;
  };
  std::vector<Count> Counts(bool compares_scales) const;
  std::vector<int32_t> Sizes() const {
    std::vector<int32_t> sizes(group_of_.size(), 0);
    for (const int32_t group : group_of_) ++sizes[group];
    return sizes;
  }

 private:
  // visit(group, how many of its frames see the track), for every track.
  template <typename Visit>
  void ForEachTrack(const Visit& visit) const;

  const KnownRotationProblem& problem_;
  const std::vector<int32_t> group_of_;  // per frame
};

// Equal ones by their numbers.
void SortStrongestFirst(std::vector<GroupPair>* pairs);

// When a group of frames is tied to others so well that it is no part of its
// own.
inline constexpr int64_t kStrongTracks = 50;
struct PartOptions {
  int64_t min_tracks = kStrongTracks;  // that it shares with others
  // Whether only tracks count that two frames of the group and two others see:
  // these compare the scales.
  bool compares_scales = true;
  double min_share = 0;  // of its tracks
};

// The part of every frame, numbered from 0 in the order of their first frames;
// the problem must be connected. A group that is tied to others becomes one
// with that which it shares most of its tracks with, until none is left; first
// the two that share most. A single frame, which has no scale, is always tied.
// O(sum over tracks of their squared lengths), a dozen times.
std::vector<int32_t> FindParts(const KnownRotationProblem& problem,
                               const PartOptions& options);

}  // namespace krot::internal
