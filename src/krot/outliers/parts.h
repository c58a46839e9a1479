#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/base/numbers.h"
#include "krot/geometry.h"
#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Calls body(a, b) for about `num_tried` of the pairs a < b of [0, count),
// spread evenly, those that are farthest apart first.
template <typename Body>
void ForSomePairs(int64_t count, int64_t num_tried, const Body& body) {
  const int64_t stride =
      std::max<int64_t>(1, count * (count - 1) / 2 / num_tried);
  int64_t pair = 0;
  for (int64_t gap = count - 1; gap > 0; --gap) {
    for (int64_t a = 0; a + gap < count; ++a, ++pair) {
      if (pair % stride == 0) body(a, a + gap);
    }
  }
}

// Two groups of frames that share tracks.
struct GroupPair {
  int32_t a = -1, b = -1;
  int64_t num_tracks = 0;  // that both see
  // Of these, those that say where one group is relative to the other, and
  // compare their scales if both have some. A track that two frames of one
  // group and a single one of the other see says where that frame is. If that
  // is always the same frame, the scales are free; so the tracks of the frame
  // that has most of them do not count, unless it is all of its group.
  int64_t num_tying = 0;
  double strength = 0;  // num_tracks, or a share
};

// Groups of frames, and which tracks they see. O(observations).
class Groups {
 public:
  // Starts with the group of every frame.
  Groups(const KnownRotationProblem& problem,
         const std::vector<int32_t>& group_of);

  // All frames of group g go over to group new_group[g].
  void Merge(const std::vector<int32_t>& new_group);

  // All pairs of groups a < b that share tracks. O(sum over tracks of their
  // squared numbers of groups).
  std::vector<GroupPair> Pairs() const;
  // Per group.
  struct Count {
    int64_t num_tracks = 0;   // that two of its frames see, or its only frame
    int64_t num_shared = 0;   // of these, those that others see, too
    int64_t num_located = 0;  // of all its tracks, those that two others see
  };
  std::vector<Count> Counts() const;
  // The number of frames of each group.
  const std::vector<int32_t>& sizes() const { return sizes_; }

 private:
  // How many frames of a group see a track.
  struct Sight {
    int32_t group;
    int32_t num_frames;
    int32_t frame;  // one of them
  };

  std::vector<int32_t> sizes_;
  std::vector<int64_t> begin_;  // of each track's sights, and their end
  std::vector<Sight> sights_;   // by track, then by group
};

// Pairs of the same strength are ordered by their numbers of tracks.
void SortStrongestFirst(std::vector<GroupPair>* pairs);

// How well a group of frames must be tied to another to be no part of its own.
inline constexpr int64_t kStrongTracks = 50;
struct PartOptions {
  // Tracks that tie both; unless scales have to be compared, those that it
  // shares with all others together, and the share of its tracks that they are.
  int64_t min_tracks = kStrongTracks;
  bool compares_scales = true;
  double min_share = 0;
};

// The part of every frame, numbered from 0 in the order of their first frames.
// The problem must be connected. All frames begin as groups of one. A group
// that is well tied to another is united with the one that ties the largest
// share of its tracks, the strongest pair first, until no such group is left;
// larger groups take any number of smaller ones at once. A single frame, which
// has no scale, always counts as tied, and so does a group with so few tracks
// of its own that others say more about it. O(sum over tracks of their squared
// lengths), a dozen times.
std::vector<int32_t> FindParts(const KnownRotationProblem& problem,
                               const PartOptions& options);
inline int32_t NumParts(const std::vector<int32_t>& part_of) {
  return 1 + *std::max_element(part_of.begin(), part_of.end());
}
// The same if only some observations tie frames, which `agrees` marks. A frame
// of which hardly any is marked is tied by all of its own.
std::vector<int32_t> FindParts(const KnownRotationProblem& problem,
                               const std::vector<char>& agrees,
                               const PartOptions& options);

// The 99.9 % quantile of chi-squared of three degrees of freedom: one right
// track in a thousand exceeds it.
inline constexpr double kCutOff = 16.3;

// What one group says about a track: its point there, and the observations that
// agree with it.
struct Side {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  std::vector<int64_t> observations;
  double sum = 0;                               // of their squared errors there
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();  // J'J of these, by the point
};

struct SharedTrack {
  Side a, b;
};

struct Place {
  // x_a = scale rotation x_b + shift
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  double cost = kInfinity;  // squared pixels
};

// The sums J'J and J'r of the errors r of a side, J their derivatives by the
// point.
struct Normal {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
};

Normal NormalOf(const KnownRotationProblem& problem,
                const std::vector<AffineMap>& cameras, const Side& side,
                const Eigen::Vector3d& x);

// Finds the place and the scale of one group relative to another by the tracks
// that both see.
class PlaceSearch {
 public:
  PlaceSearch(const KnownRotationProblem& problem, const Estimate& estimate,
              double sigma, std::vector<SharedTrack> tracks)
      : problem_(problem),
        cameras_(CamerasFromWorld(problem, estimate.translations)),
        variance_(sigma * sigma),
        tracks_(std::move(tracks)) {}

  // The best of the places that pairs of tracks propose; none if there are too
  // few tracks.
  std::optional<Place> Propose() const;
  // The same with a rotation, which three tracks propose; for few tracks, too.
  std::optional<Place> ProposeTurned() const;
  // Infinite if it is `limit` or more.
  double Cost(const Place& place, double limit = kInfinity) const {
    double sum = 0;
    for (const SharedTrack& track : tracks_) {
      sum += BestPoint(track, place).second;
      if (sum >= limit) return kInfinity;
    }
    return sum;
  }
  // The best place for each of the scales, lowest cost first.
  std::vector<Place> Profile(const std::vector<double>& scales,
                             const Context& context) const;
  int64_t NumAgreeing(const Place& place) const {
    return std::count_if(
        tracks_.begin(), tracks_.end(), [&](const SharedTrack& track) {
          return BestPoint(track, place).second < kCutOff * variance_;
        });
  }
  // The standard deviation of a scale, with the shift and all points free, to
  // first order; infinite if the tracks that agree do not hold it.
  double ScaleDeviation(const Place& place) const;
  // Three standard deviations, squared: costs that rise by less are no worse.
  double no_worse() const { return 9 * variance_; }

 private:
  double SquaredError(int64_t i, const Eigen::Vector3d& x) const {
    const Observation& o = problem_.observations[i];
    const double error =
        ResidualOf(ViewPoint(cameras_[o.view], o, x), Norm::L2());
    return error * error;
  }
  // At most `limit`: no more is added once that is reached.
  double CostAt(const SharedTrack& track, const Place& place,
                const Eigen::Vector3d& x, double limit) const {
    double sum = -track.a.sum - track.b.sum;
    for (const int64_t i : track.a.observations) {
      sum += SquaredError(i, x);
      if (!(sum < limit)) return limit;
    }
    const Eigen::Vector3d x_b =
        place.rotation.transpose() * (x - place.shift) / place.scale;
    for (const int64_t i : track.b.observations) {
      sum += SquaredError(i, x_b);
      if (!(sum < limit)) return limit;
    }
    return std::max(sum, 0.0);
  }
  std::pair<Eigen::Vector3d, double> BestPoint(const SharedTrack& track,
                                               const Place& place) const;
  std::vector<const SharedTrack*> TracksWithPoints() const;
  static Eigen::Matrix3d WeightOf(const SharedTrack& track, double scale);
  std::pair<Eigen::Matrix4d, Eigen::Vector4d> NormalOfPlace(
      const Place& place) const;
  Place BestPlace(double scale) const;
  Place Improve(const Place& place, bool is_scale_free) const;
  Place ImproveAll(Place place, bool is_scale_free) const;

  const KnownRotationProblem& problem_;
  const std::vector<AffineMap> cameras_;  // each in its group's coordinates
  const double variance_;
  const std::vector<SharedTrack> tracks_;
};

// Two groups of frames that few tracks join, and how well these hold the scale
// of one relative to the other.
struct WeakLink {
  std::vector<int32_t> frames;  // of the smaller group, ascending
  int64_t num_tracks = 0;       // that frames of both groups see
  int64_t num_of_three = 0;     // of these, with three observations or more
  // Of num_tracks: the tracks that say something about place and scale, and
  // those among them that agree with the best place and scale.
  int64_t num_telling = 0;
  int64_t num_agreeing = 0;
  // Of the tracks within groups, those with which all their observations agree.
  double usual_share = 1;
  // The group could be larger or smaller by about this factor, and the tracks
  // would fit as well; infinite if any scale fits. >= 1.
  double scale_factor = 1;
  // By how much the group's rotations would all have to turn relative to the
  // others', degrees, for more tracks to agree, and how many would agree then;
  // 0: no turn was found. Nothing is turned, as rotations are known.
  double turn_deg = 0;
  int64_t num_agreeing_turned = 0;

  // Whether scale and place can be relied on: the scale is held to a tenth, and
  // more tracks agree than disagree; or no turn was found, and as large a share
  // agrees as elsewhere. As any two tracks agree at some place and scale, fewer
  // than six are no such share.
  bool IsHeld() const {
    const double share = static_cast<double>(num_agreeing) /
                         static_cast<double>(std::max<int64_t>(1, num_telling));
    return scale_factor <= 1.1 &&
           (share > 0.5 ||
            (turn_deg == 0 && share > usual_share && num_agreeing >= 6));
  }
};

// Makes one estimate of those of all parts, each of which has its own place and
// scale. The two groups that share most tracks are joined first, and so on, at
// that place and scale, of those that pairs of tracks propose, at which the
// tracks of both fit best: the cost is the sum of squared reprojection errors,
// limited for each track, so that some tracks may be wrong.
//
// Changes the translations of `*estimate` and those of its points that belong
// to a part (point_part; -1: none).
void JoinParts(const KnownRotationProblem& problem,
               const std::vector<int32_t>& parts,
               const std::vector<int32_t>& point_part, double cap,
               const Context& context, Estimate* estimate);

// Scales are tried and told up to this factor.
inline constexpr double kLargestScale = 30;

// The part of a problem that could grow or shrink most at a small rise of the
// errors of the `kept` observations (marked), which alone count: hinges are
// found. To first order: scale_factor is 1 + 3 standard deviations. Of the
// estimate only the translations are used. Points are placed as FindWeakLinks
// does. None if nothing can grow.
std::optional<WeakLink> FindSoftPart(const KnownRotationProblem& problem,
                                     const Estimate& estimate,
                                     const std::vector<char>& kept, double cap,
                                     const Context& context);

// Averaged rotations are off by tenths of a degree. If turns up to this could
// stand for all baselines, such errors could be a tenth of these; radians.
inline constexpr double kLikelyTurn = 1 / kDegreesPerRadian;

// The largest turn of a frame, degrees, with which one common centre of all
// frames explains the observations as well as the estimate does, which must be
// one of least squares: then nothing tells baselines from noise and errors of
// the rotations. Of F frames and K points baselines and depths are 3 F and K
// parameters, which fit noise of variance sigma^2 by at most
// 2 (3 F + K) sigma^2, as the largest singular value of a matrix of such noise
// is at most sigma (sqrt(3 F) + sqrt(K)). None if one centre explains less or
// only with turns above kLikelyTurn, where observations are too few to tell, or
// with baselines in rigs.
// Turns and directions are improved in turn, for as long as they may get there;
// O(observations) each time.
std::optional<double> FindTurnAtOneCentre(const KnownRotationProblem& problem,
                                          const Estimate& estimate,
                                          const Context& context);

// The links between the parts of an estimate, of which only the translations
// are used: how much could the scales differ from the estimate's?
// For every scale on a fine logarithmic grid the best place is found. Scales
// whose cost is above the lowest by at most three standard deviations of the
// noise may be right, too: WeakLink::scale_factor.
// Parts are those that the `kept` observations (marked) tie; all judge links.
// For every connected component; none where no part hangs on few tracks. All
// components but the largest come last, with no tracks. Points are placed anew,
// and no error counts for more than `cap`, pixels.
std::vector<WeakLink> FindWeakLinks(const KnownRotationProblem& problem,
                                    const Estimate& estimate,
                                    const std::vector<char>& kept, double cap,
                                    const Context& context);

// Of every observation; infinite where it does not see its point.
std::vector<double> SquaredErrorsAt(const KnownRotationProblem& problem,
                                    const Estimate& estimate);

// The noise per axis, pixels, from the median error of the observations that
// count, each freed of what its own track's point has fitted of it. Tracks of
// one are left out. O(observations).
double NoiseOf(const KnownRotationProblem& problem, const Estimate& estimate,
               const std::function<bool(int64_t i)>& counts);

}  // namespace krot::internal
