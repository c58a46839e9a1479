#include "krot/outliers/parts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "krot/base/numbers.h"
#include "krot/outliers/robust_start.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// The ratio of neighbours on the grid of scales.
constexpr double kScaleStep = 1.05;
// Observations agree with a point up to so many standard deviations.
constexpr double kAgreeing = 4;

std::vector<double> ScalesAround(double scale, double step, int num_steps) {
  std::vector<double> scales;
  for (int n = -num_steps; n <= num_steps; ++n) {
    scales.push_back(scale * std::pow(step, n));
  }
  return scales;
}

// Joins groups of frames until none share tracks.
class Joiner {
 public:
  Joiner(const KnownRotationProblem& problem, std::vector<int32_t> parts,
         std::vector<int32_t> point_part, double cap, bool may_move,
         const Context& context, Estimate* estimate)
      : problem_(problem),
        context_(context),
        cap_(cap),
        may_move_(may_move),
        group_of_(std::move(parts)),
        point_group_(std::move(point_part)),
        estimate_(*estimate) {}

  std::vector<WeakLink> Run() {
    sigma_ = std::max(NoiseOf(problem_, estimate_,
                              [this](int64_t i) { return TellsNoise(i); }),
                      cap_ / kAgreeing);
    if (!may_move_) usual_share_ = UsualShare();
    std::vector<WeakLink> links;
    for (;;) {
      std::vector<GroupPair> pairs = Groups(problem_, group_of_).Pairs();
      if (pairs.empty()) return links;
      SortStrongestFirst(&pairs);
      std::vector<char> has_stronger(problem_.num_frames, 0);
      for (const GroupPair& pair : pairs) {
        if (context_.IsCancelled()) return links;
        const bool is_strongest =
            !has_stronger[pair.a] && !has_stronger[pair.b];
        has_stronger[pair.a] = has_stronger[pair.b] = 1;
        if (!is_strongest) continue;
        context_.Stage(may_move_ ? "joining parts"
                                 : "measuring how well few tracks hold parts",
                       static_cast<int64_t>(links.size()) + 1);
        links.push_back(Join(pair));
      }
    }
  }

 private:
  // What some frames (marked) say about points, which each of them sees.
  std::vector<Side> SidesOf(const std::vector<int32_t>& points,
                            const std::vector<char>& frames) {
    std::vector<int64_t> observations;
    for (const int32_t k : points) {
      for (const int64_t i : problem_.OfPoint(k)) {
        if (frames[problem_.FrameOf(i)]) observations.push_back(i);
      }
    }
    const ProblemSubset part(problem_, observations);
    const KnownRotationProblem& own = part.problem();
    Estimate estimate = part.Restrict(estimate_);
    const double cap = kAgreeing * sigma_;
    PlacePointsRobustly(own, AllPoints(own), Norm::L2(), cap, context_,
                        &estimate);
    const std::vector<AffineMap> cameras =
        CamerasFromWorld(problem_, estimate_.translations);
    std::vector<Side> sides(points.size());
    for (int32_t k = 0; k < own.num_points; ++k) {
      Side& side = sides[k];
      side.x = estimate.points[k];
      for (const int64_t i : own.OfPoint(k)) {
        const double error = ResidualOf(
            ViewPoint(own, own.observations[i], estimate), Norm::L2());
        if (!(error < cap)) continue;
        side.observations.push_back(part.InWhole(i));
        side.sum += error * error;
      }
      // If only one of several is left, it is not known which one is right.
      if (side.observations.size() == 1 &&
          own.point_begin[k + 1] - own.point_begin[k] > 1) {
        side.observations.clear();
      }
      side.H = NormalOf(problem_, cameras, side, side.x).H;
    }
    return sides;
  }

  // Whether an observation belongs to the group of its point, which more than
  // two see.
  bool TellsNoise(int64_t i) const {
    const int32_t k = problem_.observations[i].point;
    return problem_.point_begin[k + 1] - problem_.point_begin[k] > 2 &&
           point_group_[k] == group_of_[problem_.FrameOf(i)];
  }

  std::vector<char> FramesOf(int32_t group) const {
    std::vector<char> frames(problem_.num_frames);
    for (int32_t f = 0; f < problem_.num_frames; ++f) {
      frames[f] = group_of_[f] == group;
    }
    return frames;
  }

  // The tracks that frames of a and b (marked) see, with at least `min_seen`
  // observations on one side; counts in *link how many both see in all.
  std::vector<SharedTrack> TracksOf(const std::vector<char>& of_a,
                                    const std::vector<char>& of_b,
                                    size_t min_seen, WeakLink* link) {
    std::vector<int32_t> points;
    for (int32_t k = 0; k < problem_.num_points; ++k) {
      int32_t num_a = 0, num_b = 0;
      for (const int64_t i : problem_.OfPoint(k)) {
        num_a += of_a[problem_.FrameOf(i)];
        num_b += of_b[problem_.FrameOf(i)];
      }
      if (num_a == 0 || num_b == 0) continue;
      points.push_back(k);
      link->num_of_three += num_a + num_b > 2;
    }
    link->num_tracks = static_cast<int64_t>(points.size());
    std::vector<Side> a = SidesOf(points, of_a);
    std::vector<Side> b = SidesOf(points, of_b);
    std::vector<SharedTrack> tracks;
    for (size_t n = 0; n < points.size(); ++n) {
      const size_t least =
          std::min(a[n].observations.size(), b[n].observations.size());
      const size_t most =
          std::max(a[n].observations.size(), b[n].observations.size());
      if (least >= 1 && most >= min_seen) {
        tracks.push_back({std::move(a[n]), std::move(b[n])});
      }
    }
    return tracks;
  }

  // WeakLink::usual_share; 1 where there are too few to tell.
  double UsualShare() const {
    int64_t num_within = 0, num_agreeing = 0;
    for (int32_t k = 0; k < problem_.num_points; ++k) {
      const int32_t group =
          group_of_[problem_.FrameOf(problem_.point_begin[k])];
      bool is_within = true, agrees = true;
      for (const int64_t i : problem_.OfPoint(k)) {
        is_within = is_within && group_of_[problem_.FrameOf(i)] == group;
        agrees =
            agrees &&
            ResidualOf(ViewPoint(problem_, problem_.observations[i], estimate_),
                       Norm::L2()) < kAgreeing * sigma_;
      }
      num_within += is_within;
      num_agreeing += is_within && agrees;
    }
    return num_within < kStrongTracks ? 1
                                      : static_cast<double>(num_agreeing) /
                                            static_cast<double>(num_within);
  }

  bool HasBaselineIn(int32_t group) const {
    return std::any_of(problem_.views.begin(), problem_.views.end(),
                       [&](const View& view) {
                         return group_of_[view.frame] == group &&
                                !view.cam_from_rig_translation.isZero(0);
                       });
  }

  WeakLink Join(GroupPair pair) {
    const bool a_is_metric = HasBaselineIn(pair.a);
    if (!a_is_metric && HasBaselineIn(pair.b)) std::swap(pair.a, pair.b);
    const bool is_scale_free = !HasBaselineIn(pair.b);
    WeakLink link;
    // A track that one frame of each group sees proposes no scale.
    const std::vector<SharedTrack> all =
        TracksOf(FramesOf(pair.a), FramesOf(pair.b), 2, &link);
    link.num_telling = static_cast<int64_t>(all.size());
    link.usual_share = usual_share_;
    std::vector<SharedTrack> some;
    const size_t stride = std::max<size_t>(1, all.size() / 200);
    for (size_t n = 0; n < all.size(); n += stride) some.push_back(all[n]);
    const PlaceSearch tracks(problem_, estimate_, sigma_, std::move(some));
    if (may_move_) {
      Unite(pair, is_scale_free ? tracks.Propose().value_or(Place())
                                : tracks.Profile({1}, context_)[0]);
      return link;
    }
    const int num_steps =
        is_scale_free
            ? static_cast<int>(std::log(kLargestScale) / std::log(kScaleStep))
            : 0;
    std::vector<Place> places =
        tracks.Profile(ScalesAround(1, kScaleStep, num_steps), context_);
    if (is_scale_free) {
      const int num_fine = 10;  // to each side, within a grid step
      const std::vector<Place> fine = tracks.Profile(
          ScalesAround(places[0].scale, std::pow(kScaleStep, 1.0 / num_fine),
                       num_fine),
          context_);
      places.insert(places.begin(), fine.begin(), fine.end());
    }
    places.emplace_back();  // the estimate's own, which a search may miss
    places.back().cost = tracks.Cost(places.back());
    const Place best = *std::min_element(
        places.begin(), places.end(),
        [](const Place& x, const Place& y) { return x.cost < y.cost; });
    const PlaceSearch of_all(problem_, estimate_, sigma_, all);
    link.num_agreeing = of_all.NumAgreeing(best);
    FindTurn(of_all, &link);
    for (const Place& place : places) {
      if (!(place.cost <= best.cost + tracks.no_worse())) continue;
      const double factor = std::max(place.scale, 1 / place.scale);
      const bool is_last = factor * kScaleStep > kLargestScale;
      link.scale_factor =
          std::max(link.scale_factor, is_last ? kInfinity : factor);
    }
    if (!std::isfinite(best.cost)) link.scale_factor = kInfinity;
    std::vector<int32_t> of_a, of_b;
    for (int32_t f = 0; f < problem_.num_frames; ++f) {
      if (group_of_[f] == pair.a) of_a.push_back(f);
      if (group_of_[f] == pair.b) of_b.push_back(f);
    }
    const bool is_b_smaller = of_b.size() <= of_a.size();
    link.frames = is_b_smaller ? of_b : of_a;
    if (!link.IsHeld()) {
      AskAllTracks(FramesOf(is_b_smaller ? pair.b : pair.a), &link);
    }
    Unite(pair, Place());
    return link;
  }

  // Whether a group is held by all others together, where two groups alone do
  // not say so. Tracks of two count as well: each gives one equation, and many
  // of them hold a scale, too. No other scales are searched, so that most
  // tracks must agree with the estimate's own.
  void AskAllTracks(const std::vector<char>& group, WeakLink* link) {
    std::vector<char> others;
    for (const char is_own : group) others.push_back(is_own == 0);
    WeakLink of_all = *link;
    of_all.num_of_three = 0;
    std::vector<SharedTrack> all = TracksOf(others, group, 1, &of_all);
    of_all.num_telling = static_cast<int64_t>(all.size());
    const PlaceSearch tracks(problem_, estimate_, sigma_, std::move(all));
    of_all.num_agreeing = tracks.NumAgreeing(Place());
    of_all.scale_factor = 1 + 3 * tracks.ScaleDeviation(Place());
    of_all.turn_deg = 0;
    if (2 * of_all.num_agreeing > of_all.num_telling && of_all.IsHeld()) {
      *link = std::move(of_all);
    }
  }

  // Any three tracks agree at some turn. So twice as many must agree.
  static void FindTurn(const PlaceSearch& tracks, WeakLink* link) {
    const std::optional<Place> turned = tracks.ProposeTurned();
    if (!turned) return;
    const int64_t count = tracks.NumAgreeing(*turned);
    if (count < 6 || 2 * count <= link->num_telling ||
        count < link->num_agreeing + 3) {
      return;
    }
    link->num_agreeing_turned = count;
    link->turn_deg = Eigen::AngleAxisd(turned->rotation).angle() * (180 / kPi);
  }

  // Moves a group by x -> scale x + shift:
  // s (R x + R_sr t) = R (s x + shift) + R_sr t'.
  void Move(int32_t group, const Place& place) {
    std::vector<char> has_moved(problem_.num_frames, 0);
    for (const View& view : problem_.views) {
      if (group_of_[view.frame] != group || has_moved[view.frame]) continue;
      has_moved[view.frame] = 1;
      Vector3d& t = estimate_.translations[view.frame];
      t = place.scale * t - view.cam_from_rig_rotation.transpose() *
                                (view.cam_from_world_rotation * place.shift);
    }
    for (int32_t k = 0; k < problem_.num_points; ++k) {
      if (point_group_[k] != group) continue;
      estimate_.points[k] = place.scale * estimate_.points[k] + place.shift;
    }
  }

  // The second group becomes part of the first.
  void Unite(const GroupPair& pair, const Place& place) {
    if (may_move_) Move(pair.b, place);
    for (std::vector<int32_t>* groups : {&group_of_, &point_group_}) {
      std::replace(groups->begin(), groups->end(), pair.b, pair.a);
    }
  }

  const KnownRotationProblem& problem_;
  const Context& context_;
  const double cap_;  // pixels
  const bool may_move_;
  std::vector<int32_t> group_of_;     // per frame
  std::vector<int32_t> point_group_;  // per point; -1: none
  Estimate& estimate_;
  double sigma_ = 0;  // pixels
  double usual_share_ = 1;
};

}  // namespace

void JoinParts(const KnownRotationProblem& problem,
               const std::vector<int32_t>& parts,
               const std::vector<int32_t>& point_part, double cap,
               const Context& context, Estimate* estimate) {
  Joiner(problem, parts, point_part, cap, /*may_move=*/true, context, estimate)
      .Run();
}

std::vector<WeakLink> FindWeakLinks(const KnownRotationProblem& problem,
                                    const Estimate& estimate,
                                    const std::vector<char>& kept, double cap,
                                    const Context& context) {
  std::vector<WeakLink> links;
  std::vector<WeakLink> others;  // than the component with most frames
  for (std::vector<int64_t>& component : SplitIntoComponents(problem)) {
    std::vector<int32_t> frames;  // of the component, as the subset has them
    for (const int64_t i : component) frames.push_back(problem.FrameOf(i));
    SortUnique(&frames);
    const ProblemSubset subset(problem, std::move(component));
    const KnownRotationProblem& own = subset.problem();
    std::vector<char> own_kept(own.observations.size());
    for (size_t i = 0; i < own_kept.size(); ++i) {
      own_kept[i] = kept[subset.InWhole(static_cast<int64_t>(i))];
    }
    WeakLink& whole = others.emplace_back();
    whole.frames = frames;
    whole.scale_factor = kInfinity;
    std::vector<int32_t> parts = FindParts(own, own_kept, {});
    if (NumParts(parts) == 1) continue;
    Estimate placed = subset.Restrict(estimate);
    PlacePointsRobustly(own, AllPoints(own), Norm::L2(), cap, context, &placed);
    if (!HasBaseline(own)) NormalizeScale(own, &placed);
    std::vector<int32_t> point_part(own.num_points);
    for (int32_t k = 0; k < own.num_points; ++k) {
      point_part[k] = parts[own.FrameOf(own.point_begin[k])];
    }
    for (WeakLink& link : Joiner(own, std::move(parts), std::move(point_part),
                                 cap, /*may_move=*/false, context, &placed)
                              .Run()) {
      for (int32_t& f : link.frames) f = subset.IsWhole() ? f : frames[f];
      links.push_back(std::move(link));
    }
  }
  // Components are not tied to the largest of them at all.
  SortLargestFirst(&others,
                   [](const WeakLink& link) { return link.frames.size(); });
  for (size_t n = 1; n < others.size(); ++n) {
    links.push_back(std::move(others[n]));
  }
  return links;
}

}  // namespace krot::internal
