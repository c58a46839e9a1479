#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/outliers/parts.h"
#include "krot/problem/cost.h"

namespace krot::internal {

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

}  // namespace krot::internal
