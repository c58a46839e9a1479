#include "krot/outliers/robust_start.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/conic/interior_point.h"
#include "krot/finish/least_squares.h"
#include "krot/linear/reduced_camera_system.h"
#include "krot/outliers/parts.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

// The size of a core, where the whole has more than twice as many. The dense
// factor of so many costs next to nothing.
constexpr int32_t kCoreFrames = 150;
// The tolerance of descents whose end another one starts from.
constexpr double kRoughly = 3e-3;

// The observations of some of the longest tracks, ascending: a track is taken
// if it sees a frame that has too little redundancy so far.
std::vector<int64_t> CoveringTracks(const KnownRotationProblem& problem,
                                    double redundancy_per_frame) {
  const auto length = [&](int32_t k) {
    return problem.point_begin[k + 1] - problem.point_begin[k];
  };
  std::vector<int32_t> longest_first = AllPoints(problem);
  SortLargestFirst(&longest_first, length);
  std::vector<double> redundancy(problem.num_frames, 0);
  std::vector<int64_t> covering;
  for (const int32_t k : longest_first) {
    bool is_needed = false;
    for (const int64_t i : problem.OfPoint(k)) {
      is_needed =
          is_needed || redundancy[problem.FrameOf(i)] < redundancy_per_frame;
    }
    if (!is_needed) continue;
    for (const int64_t i : problem.OfPoint(k)) {
      redundancy[problem.FrameOf(i)] += 2 - 3 / static_cast<double>(length(k));
      covering.push_back(i);
    }
  }
  std::sort(covering.begin(), covering.end());
  return covering;
}

// The same with as much redundancy as it takes to connect all tracks, 120 for
// each frame at least. A track of n observations has 2 n - 3.
std::vector<int64_t> ConnectedTracks(const KnownRotationProblem& problem) {
  for (double per_frame = 120;; per_frame *= 2) {
    std::vector<int64_t> tracks = CoveringTracks(problem, per_frame);
    if (tracks.size() == problem.observations.size() ||
        SplitIntoComponents(problem, tracks).size() == 1) {
      return tracks;
    }
  }
}

// Solves the slack programme of some tracks, then places all other points.
Estimate StartByProgramme(const KnownRotationProblem& problem,
                          const std::vector<int64_t>& tracks, Norm norm,
                          double level, const Context& context) {
  Estimate estimate = AllAtOrigin(problem);
  const ProblemSubset part(problem, tracks);
  Estimate own = part.Restrict(estimate);
  SlackOptions options;
  options.norm = norm;
  options.smallest_mu = 1e-3;   // a start needs no smaller
  options.max_iterations = 30;  // where it takes more, it gets no better
  for (int n = 1; n <= 2 && !context.IsCancelled(); ++n) {
    context.Stage("positions from rotations and tracks, programme", n, 2);
    const SlackSolution solution =
        MinimizeSlack(part.problem(), level, options, context, &own);
    options.weights = WeightsAgainst(solution.slack, level, /*dear=*/0.1);
  }
  part.Replace(own, &estimate);
  std::vector<char> is_placed(problem.num_points, 0);
  for (const int64_t i : tracks) is_placed[problem.observations[i].point] = 1;
  std::vector<int32_t> others;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    if (!is_placed[k]) others.push_back(k);
  }
  PlacePointsRobustly(problem, others, norm, kCapOfPoints * level, context,
                      &estimate);
  return estimate;
}

// Places a core of frames by a programme, and then, ring by ring as in
// incremental mapping, those that see most placed points. This is for problems
// of which the programme of all frames would have too full a matrix.
class GrownStart {
 public:
  GrownStart(const KnownRotationProblem& problem, Norm norm, double level,
             const Context& context)
      : problem_(problem),
        norm_(norm),
        level_(level),
        context_(context),
        estimate_(AllAtOrigin(problem)),
        is_frame_(problem.num_frames, 0),
        is_point_(problem.num_points, 0) {}

  Estimate Find() {
    ChooseCore();
    const ProblemSubset core(problem_, SeenTwice());
    Estimate own =
        StartByProgramme(core.problem(), ConnectedTracks(core.problem()), norm_,
                         level_, context_);
    MinimizeRobustly(core.problem(), context_, &own, kRoughly);
    if (!HasBaseline(problem_)) NormalizeScale(core.problem(), &own);
    core.Replace(own, &estimate_);
    MarkPoints(core);
    int32_t num_improved = kCoreFrames;
    while (!context_.IsCancelled() && AddFrames()) {
      const ProblemSubset placed(problem_, SeenTwice());
      Estimate grown = placed.Restrict(estimate_);
      // After the last ring all points are placed again: more frames see them
      // now.
      std::vector<int32_t> points;
      for (int32_t k = 0; k < problem_.num_points; ++k) {
        const std::optional<int32_t> own_k = placed.FindPoint(k);
        if (own_k && (num_left_ == 0 || !is_point_[k])) {
          points.push_back(*own_k);
        }
      }
      PlacePointsRobustly(placed.problem(), points, norm_,
                          kCapOfPoints * level_, context_, &grown);
      const int32_t num_placed = problem_.num_frames - num_left_;
      if (num_left_ > 0 && num_placed >= 2 * num_improved) {
        MinimizeRobustly(placed.problem(), context_, &grown, kRoughly);
        num_improved = num_placed;
      }
      placed.Replace(grown, &estimate_);
      MarkPoints(placed);
    }
    return std::move(estimate_);
  }

 private:
  // Adds one frame at a time: the one that sees most points of those before it.
  void ChooseCore() {
    std::vector<int64_t> num_shared(problem_.num_frames, 0);
    std::vector<char> is_seen(problem_.num_points, 0);
    const auto most = [](const std::vector<int64_t>& counts) {
      return std::max_element(counts.begin(), counts.end()) - counts.begin();
    };
    std::vector<int64_t> num_seen(problem_.num_frames);
    for (int32_t f = 0; f < problem_.num_frames; ++f) {
      num_seen[f] = problem_.frame_begin[f + 1] - problem_.frame_begin[f];
    }
    for (int n = 0; n < kCoreFrames; ++n) {
      const int64_t f = most(n == 0 ? num_seen : num_shared);
      is_frame_[f] = 1;
      num_shared[f] = -1;
      for (const int32_t i : problem_.OfFrame(f)) {
        const int32_t k = problem_.observations[i].point;
        if (std::exchange(is_seen[k], 1)) continue;
        for (const int64_t j : problem_.OfPoint(k)) {
          const int32_t other = problem_.FrameOf(j);
          if (!is_frame_[other]) ++num_shared[other];
        }
      }
    }
    num_left_ = problem_.num_frames - kCoreFrames;
  }

  // The observations by placed frames of points that two or more of them see.
  std::vector<int64_t> SeenTwice() const {
    return SplitIntoParts(problem_, is_frame_)[1];
  }

  void MarkPoints(const ProblemSubset& placed) {
    for (int32_t k = 0; k < problem_.num_points; ++k) {
      if (placed.FindPoint(k)) is_point_[k] = 1;
    }
  }

  // Places the frames that see at least half as many placed points as the frame
  // that sees most. False if all are placed already.
  bool AddFrames() {
    if (num_left_ == 0) return false;
    std::vector<int64_t> num_seen(problem_.num_frames, -1);
    for (int32_t f = 0; f < problem_.num_frames; ++f) {
      if (is_frame_[f]) continue;
      num_seen[f] = 0;
      for (const int32_t i : problem_.OfFrame(f)) {
        num_seen[f] += is_point_[problem_.observations[i].point];
      }
    }
    const int64_t most = *std::max_element(num_seen.begin(), num_seen.end());
    std::vector<int32_t> added;
    for (int32_t f = 0; f < problem_.num_frames; ++f) {
      if (!is_frame_[f] && 2 * num_seen[f] >= most) added.push_back(f);
    }
    context_.Stage("positions from rotations and tracks, images",
                   problem_.num_frames - num_left_, problem_.num_frames);
    PlaceFramesRobustly(problem_, added, is_point_, norm_,
                        kCapOfPoints * level_, context_, &estimate_);
    for (const int32_t f : added) is_frame_[f] = 1;
    num_left_ -= static_cast<int32_t>(added.size());
    return true;
  }

  const KnownRotationProblem& problem_;
  const Norm norm_;
  const double level_;
  const Context& context_;
  Estimate estimate_;
  std::vector<int32_t> is_frame_;  // placed: 1, otherwise 0
  std::vector<char> is_point_;     // placed
  int32_t num_left_ = 0;           // frames
};

// The start of a part whose frames are well tied.
Estimate StartOfPart(const KnownRotationProblem& problem, Norm norm,
                     double level, const Context& context) {
  const std::vector<int64_t> tracks = ConnectedTracks(problem);
  const ProblemSubset part(problem, tracks);
  const bool is_full =
      problem.num_frames > 2 * kCoreFrames && !HasFixed(problem) &&
      ReducedCameraSystem(AnchoredStructure(part.problem())).kind() !=
          ReducedCameraSystem::Kind::kSparse;
  Estimate estimate =
      is_full ? GrownStart(problem, norm, level, context).Find()
              : StartByProgramme(problem, tracks, norm, level, context);
  if (!HasBaseline(problem)) NormalizeScale(problem, &estimate);
  return estimate;
}

// The start of parts that share few of their tracks; none if there is only one.
std::optional<Estimate> StartOfParts(const KnownRotationProblem& problem,
                                     Norm norm, double level,
                                     const Context& context) {
  PartOptions options;
  options.min_tracks = 1;
  options.compares_scales = false;
  options.min_share = 0.2;
  const std::vector<int32_t> part_of = FindParts(problem, options);
  if (NumParts(part_of) == 1) return std::nullopt;
  Estimate estimate = AllAtOrigin(problem);
  PlaceParts(
      problem, part_of, norm, level, context,
      [&](const KnownRotationProblem& part, const Context& within,
          Estimate* own) {
        *own = StartOfPart(part, norm, level, within);
        MinimizeRobustly(part, within, own);
      },
      &estimate);
  return estimate;
}

Estimate StartOfComponent(const KnownRotationProblem& problem, Norm norm,
                          double level, const Context& context) {
  const double cap = kCapOfPoints * level;
  std::optional<Estimate> of_parts =
      StartOfParts(problem, norm, level, context);
  const int32_t num_untied =
      of_parts ? MinimizeAndJoin(problem, norm, level, context, &*of_parts) : 0;
  if (num_untied == 1) return std::move(*of_parts);
  // No start ties what too few tracks join even if all of them are right.
  if (of_parts && MedianError(problem, *of_parts, norm) <= cap &&
      num_untied <= NumParts(FindParts(problem, PartOptions()))) {
    return std::move(*of_parts);
  }
  Estimate whole = StartOfPart(problem, norm, level, context);
  const int32_t num_untied_of_whole =
      MinimizeAndJoin(problem, norm, level, context, &whole);
  if (!of_parts) return whole;
  const auto rank = [&](const Estimate& estimate, int32_t num_parts) {
    return std::make_tuple(!(MedianError(problem, estimate, norm) <= cap),
                           num_parts,
                           -NumAgreeing(problem, estimate, norm, cap));
  };
  return std::move(rank(whole, num_untied_of_whole) <
                           rank(*of_parts, num_untied)
                       ? whole
                       : *of_parts);
}

}  // namespace

Estimate FindRobustStart(const KnownRotationProblem& problem, Norm norm,
                         double level, const Context& context) {
  Estimate estimate = AllAtOrigin(problem);
  for (std::vector<int64_t>& component : SplitIntoComponents(problem)) {
    const ProblemSubset part(problem, std::move(component));
    part.Replace(StartOfComponent(part.problem(), norm, level, context),
                 &estimate);
  }
  return estimate;
}

double MedianError(const KnownRotationProblem& problem,
                   const Estimate& estimate, Norm norm) {
  std::vector<double> errors;
  for (const Observation& o : problem.observations) {
    errors.push_back(ResidualOf(ViewPoint(problem, o, estimate), norm));
  }
  return errors.empty() ? 0 : Median(std::move(errors));
}

}  // namespace krot::internal
