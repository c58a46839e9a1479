#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/problem/cost.h"
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

// Groups of frames, and what they see of the tracks. O(observations).
class Groups {
 public:
  // Starts with the group of every frame.
  Groups(const KnownRotationProblem& problem,
         const std::vector<int32_t>& group_of);

  // All frames of group g go over to group new_group[g].
  void Merge(const std::vector<int32_t>& new_group);

  // Every two groups a < b that share tracks, with how many. O(sum over tracks
  // of their squared numbers of groups).
  std::vector<GroupPair> Pairs() const;
  // Per group: the tracks that two of its frames see or, if it is one, this
  // one, in all and of these those that others see, too: two others at least,
  // if the scales are to be compared.
  struct Count {
    int64_t num_tracks = 0;
    int64_t num_shared = 0;
    // That two others see, whether two of its frames see them or one.
    int64_t num_located = 0;
  };
  std::vector<Count> Counts(bool compares_scales) const;
  // The number of frames of each group.
  const std::vector<int32_t>& sizes() const { return sizes_; }

 private:
  // How many frames of a group see a track.
  struct Sight {
    int32_t group;
    int32_t num_frames;
  };

  std::vector<int32_t> sizes_;
  std::vector<int64_t> begin_;  // of each track's sights, and their end
  std::vector<Sight> sights_;   // by track, then by group
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
// the two that share most. A single frame, which has no scale, is always tied,
// and so is a group of so few tracks of its own that others say more.
// O(sum over tracks of their squared lengths), a dozen times.
std::vector<int32_t> FindParts(const KnownRotationProblem& problem,
                               const PartOptions& options);

// Chi-squared of three degrees of freedom: one right track in a thousand has
// more.
inline constexpr double kCutOff = 16.3;
// Three standard deviations.
inline constexpr double kNoWorse = 9;

// What one group says of a track: its point there, and the observations that
// agree with that.
struct Side {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  std::vector<int64_t> observations;
  double sum = 0;                               // of their squared errors there
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();  // of that, by the point
};

struct SharedTrack {
  Side a, b;
};

struct Place {
  // x_a = scale rotation x_b + shift
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  double cost = std::numeric_limits<double>::infinity();  // squared pixels
};

// Squared errors and their derivatives by the point; both add up.
struct Normal {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
};

Normal NormalOf(const KnownRotationProblem& problem,
                const std::vector<AffineMap>& cameras, const Side& side,
                const Eigen::Vector3d& x);

// The place and the scale of one group against another, as their tracks have
// it.
class PlaceSearch {
 public:
  PlaceSearch(const KnownRotationProblem& problem, const Estimate& estimate,
              double sigma, std::vector<SharedTrack> tracks)
      : problem_(problem),
        cameras_(CamerasFromWorld(problem, estimate.translations)),
        variance_(sigma * sigma),
        tracks_(std::move(tracks)) {}

  // The best that two tracks with points on either side propose, for many such
  // pairs; none where there are few such tracks.
  std::optional<Place> Propose() const;
  // The same with a turn, which three tracks propose; for few tracks, too.
  std::optional<Place> ProposeTurned() const;
  double Cost(const Place& place) const {
    double sum = 0;
    for (const SharedTrack& track : tracks_) {
      sum += std::min(BestPoint(track, place).second, kCutOff * variance_);
    }
    return sum;
  }
  // The best of all scales first.
  std::vector<Place> Profile(const std::vector<double>& scales,
                             const Context& context) const;
  int64_t NumAgreeing(const Place& place) const {
    return std::count_if(
        tracks_.begin(), tracks_.end(), [&](const SharedTrack& track) {
          return BestPoint(track, place).second < kCutOff * variance_;
        });
  }
  double no_worse() const { return kNoWorse * variance_; }

 private:
  double SquaredError(int64_t i, const Eigen::Vector3d& x) const {
    const Observation& o = problem_.observations[i];
    const double error =
        ResidualOf(ViewPoint(cameras_[o.view], o, x), Norm::L2());
    return error * error;
  }
  double CostAt(const SharedTrack& track, const Place& place,
                const Eigen::Vector3d& x) const {
    double sum = -track.a.sum - track.b.sum;
    const Eigen::Vector3d x_b =
        place.rotation.transpose() * (x - place.shift) / place.scale;
    for (const int64_t i : track.a.observations) sum += SquaredError(i, x);
    for (const int64_t i : track.b.observations) sum += SquaredError(i, x_b);
    return std::max(sum, 0.0);
  }
  std::pair<Eigen::Vector3d, double> BestPoint(const SharedTrack& track,
                                               const Place& place) const;
  std::vector<const SharedTrack*> TracksWithPoints() const;
  Place BestPlace(double scale) const;
  Place Improve(const Place& place) const;

  const KnownRotationProblem& problem_;
  const std::vector<AffineMap> cameras_;  // each in its group's coordinates
  const double variance_;
  const std::vector<SharedTrack> tracks_;
};

// Parts of a problem that few tracks join, and how well these hold the scale of
// one part against that of the other.

// Two groups of frames that few tracks join.
struct WeakLink {
  std::vector<int32_t> frames;  // of the smaller group, ascending
  int64_t num_tracks = 0;       // that frames of both groups see
  // Of these: the tracks that say something about place and scale, and of these
  // those that agree on the place and the scale that most agree on.
  int64_t num_telling = 0;
  int64_t num_agreeing = 0;
  // The group may be larger or smaller by this factor, about, and the tracks
  // would fit as well; infinite if any scale fits. >= 1.
  double scale_factor = 1;
  // By how much the group's rotations, all alike, would have to turn against
  // the others', degrees, for more tracks to agree, and how many then would;
  // 0: no turn was found. Rotations are known, so that nothing turns.
  double turn_deg = 0;
  int64_t num_agreeing_turned = 0;

  // Beyond this factor, and where the tracks that agree are no more than those
  // that do not, nobody should rely on scale and place.
  bool IsHeld() const {
    return scale_factor <= 1.1 && 2 * num_agreeing > num_telling;
  }
};

// Makes one estimate of those of all parts, whose places and scales have
// nothing to do with each other: the two groups that share most tracks are
// joined first, and so on. For every scale on a fine logarithmic grid the place
// is found at which the tracks of both fit best, whatever some of them say
// (reprojection errors, squared, each track's cut off); of all scales the best
// is taken. A scale that is no worse by more than three standard deviations of
// the noise may be the right one, too: WeakLink::scale_factor.
//
// Translations of `*estimate` change; points that it has are those of their
// part (point_part; -1: it has none) and change with it.
std::vector<WeakLink> JoinParts(const KnownRotationProblem& problem,
                                const std::vector<int32_t>& parts,
                                const std::vector<int32_t>& point_part,
                                double cap, const Context& context,
                                Estimate* estimate);

// The same links of an estimate that is one already, of which only the
// translations count: by how much the scales could be other than they are.
// Every component's; none where no part hangs on few tracks. Points are placed
// anew, no error counted for more than `cap`, pixels.
std::vector<WeakLink> FindWeakLinks(const KnownRotationProblem& problem,
                                    const Estimate& estimate, double cap,
                                    const Context& context);

}  // namespace krot::internal
