#include "krot/outliers/packing.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "krot/base/parallel_for.h"
#include "krot/bridge/built_part.h"
#include "krot/bridge/reprojection.h"
#include "krot/problem/components.h"
#include "krot/problem/subset.h"
#include "krot/sweeps/block_sweep.h"

namespace krot {
namespace {

using Eigen::Vector3d;

// Of the points that two frames see: so many with the most strained rays are
// looked at.
constexpr int kStrainedPoints = 16;
// Frames of a track that are looked at together; no more.
constexpr size_t kMaxFramesTogether = 8;
constexpr size_t kFramesInTriples = 4;
// Parts of the tight observations that are larger are left alone.
constexpr size_t kMaxTight = 400;

class Packing {
 public:
  Packing(const Model& model, const BuiltProblem& built,
          const ErrorBound& bound, const Removal& removal,
          const Context& context)
      : model_(model),
        built_(built),
        problem_(built.problem),
        bound_(bound),
        removal_(removal),
        context_(context),
        is_free_(problem_.observations.size(), 1),
        is_taken_(problem_.observations.size(), 0),
        points_of_frame_(problem_.num_frames) {
    small_context_ = context;
    small_context_.num_threads = 1;
    for (const int64_t i : removal.observations) is_free_[i] = 0;
    for (int32_t f = 0; f < problem_.num_frames; ++f) {
      for (int64_t n = problem_.frame_begin[f]; n < problem_.frame_begin[f + 1];
           ++n) {
        const int32_t k =
            problem_.observations[problem_.frame_observations[n]].point;
        std::vector<int32_t>& points = points_of_frame_[f];
        if (points.empty() || points.back() != k) points.push_back(k);
      }
    }
  }

  std::vector<Conflict> Run();

 private:
  int32_t FrameOf(int64_t i) const {
    return problem_.views[problem_.observations[i].view].frame;
  }
  Vector3d Direction(int64_t i) const;
  Vector3d CentreOf(int64_t i) const;
  double Strain(int64_t i, int64_t j) const;
  void AddStrained(int32_t a, int32_t b, std::vector<int32_t>* points) const;
  std::vector<int64_t> Neighbourhood(int64_t i,
                                     std::vector<int32_t> frames) const;
  std::vector<std::vector<int32_t>> FrameSets(int64_t i, int num_others) const;
  bool FitsIn(int64_t i, const std::vector<int32_t>& frames) const;
  std::optional<Conflict> Try(int64_t i,
                              const std::vector<int32_t>& frames) const;
  bool IsTaken(int64_t i) const { return is_taken_[i] != 0; }
  bool Charge(int64_t i, int num_others);
  void Charge(std::vector<std::pair<double, int64_t>>* open);
  void ChargeTight();
  void Take(Conflict conflict);

  const Model& model_;
  const BuiltProblem& built_;
  const KnownRotationProblem& problem_;
  const ErrorBound bound_;
  const Removal& removal_;
  const Context context_;
  Context small_context_;
  std::vector<char> is_free_;   // to make conflicts with others
  std::vector<char> is_taken_;  // by a conflict
  std::vector<std::vector<int32_t>> points_of_frame_;  // ascending
  std::vector<Conflict> conflicts_;
};

// Of the ray on which v = 0, in the world.
Vector3d Packing::Direction(int64_t i) const {
  const Observation& o = problem_.observations[i];
  const Vector3d u = o.E.row(1).cross(o.E.row(2)).transpose();
  return (problem_.views[o.view].cam_from_world_rotation.transpose() * u)
      .normalized();
}

Vector3d Packing::CentreOf(int64_t i) const {
  const View& view = problem_.views[problem_.observations[i].view];
  const AffineMap map =
      CamFromWorld(view, removal_.estimate.translations[view.frame]);
  return -map.leftCols<3>().transpose() * map.col(3);
}

// By how much two rays miss each other, about, pixels: their epipolar error.
double Packing::Strain(int64_t i, int64_t j) const {
  const Vector3d baseline = CentreOf(j) - CentreOf(i);
  const Vector3d normal = baseline.cross(Direction(i));
  const double length = normal.norm();
  if (!(length > 0)) return 0;
  const double angle = std::abs(normal.dot(Direction(j))) / length;
  return angle * problem_.observations[j].E.bottomRows<2>().norm();
}

// The points that both frames see freely, the most strained.
void Packing::AddStrained(int32_t a, int32_t b,
                          std::vector<int32_t>* points) const {
  std::vector<int32_t> common;
  std::set_intersection(points_of_frame_[a].begin(), points_of_frame_[a].end(),
                        points_of_frame_[b].begin(), points_of_frame_[b].end(),
                        std::back_inserter(common));
  std::vector<std::pair<double, int32_t>> strained;  // -strain, point
  for (const int32_t k : common) {
    int64_t in_a = -1;
    int64_t in_b = -1;
    for (int64_t i = problem_.point_begin[k]; i < problem_.point_begin[k + 1];
         ++i) {
      if (!is_free_[i]) continue;
      if (FrameOf(i) == a) in_a = i;
      if (FrameOf(i) == b) in_b = i;
    }
    if (in_a >= 0 && in_b >= 0) strained.emplace_back(-Strain(in_a, in_b), k);
  }
  const size_t count =
      std::min(strained.size(), static_cast<size_t>(kStrainedPoints));
  std::partial_sort(strained.begin(),
                    strained.begin() + static_cast<std::ptrdiff_t>(count),
                    strained.end());
  for (size_t n = 0; n < count; ++n) points->push_back(strained[n].second);
}

// Observation i, and free ones of the frames.
std::vector<int64_t> Packing::Neighbourhood(int64_t i,
                                            std::vector<int32_t> frames) const {
  frames.push_back(FrameOf(i));
  std::sort(frames.begin(), frames.end());
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  std::vector<int32_t> points = {problem_.observations[i].point};
  for (size_t n = 0; n < frames.size(); ++n) {
    for (size_t m = 0; m < n; ++m) AddStrained(frames[m], frames[n], &points);
  }
  std::sort(points.begin(), points.end());
  points.erase(std::unique(points.begin(), points.end()), points.end());
  std::vector<int64_t> observations;
  for (const int32_t k : points) {
    for (int64_t j = problem_.point_begin[k]; j < problem_.point_begin[k + 1];
         ++j) {
      const bool is_there =
          std::binary_search(frames.begin(), frames.end(), FrameOf(j));
      if (j == i || (is_free_[j] && is_there)) observations.push_back(j);
    }
  }
  return observations;
}

// Those of the track, beside its own, that observation i is tried with: the
// most strained first.
std::vector<std::vector<int32_t>> Packing::FrameSets(int64_t i,
                                                     int num_others) const {
  const int32_t k = problem_.observations[i].point;
  std::vector<std::pair<double, int32_t>> strained;  // -strain, frame
  for (int64_t j = problem_.point_begin[k]; j < problem_.point_begin[k + 1];
       ++j) {
    if (is_free_[j] && j != i) strained.emplace_back(-Strain(i, j), FrameOf(j));
  }
  std::sort(strained.begin(), strained.end());
  std::vector<int32_t> others;
  for (const auto& [strain, frame] : strained) {
    if (std::find(others.begin(), others.end(), frame) == others.end()) {
      others.push_back(frame);
    }
  }
  if (others.size() > kMaxFramesTogether) others.resize(kMaxFramesTogether);
  std::vector<std::vector<int32_t>> sets;
  if (num_others == 1) {
    for (const int32_t f : others) sets.push_back({f});
  } else if (num_others == 2) {
    for (size_t n = 0; n < std::min(others.size(), kFramesInTriples); ++n) {
      for (size_t m = 0; m < n; ++m) sets.push_back({others[m], others[n]});
    }
  } else if (others.size() > 2) {
    sets.push_back(others);
  }
  return sets;
}

// Whether observation i and the others of its point in the frames are within
// the bound where the frames stand, as all that stay are: then they are part of
// no conflict with these.
bool Packing::FitsIn(int64_t i, const std::vector<int32_t>& frames) const {
  const int32_t k = problem_.observations[i].point;
  std::vector<int64_t> observations;
  for (int64_t j = problem_.point_begin[k]; j < problem_.point_begin[k + 1];
       ++j) {
    const bool is_there =
        std::find(frames.begin(), frames.end(), FrameOf(j)) != frames.end() ||
        FrameOf(j) == FrameOf(i);
    if (j == i || (is_free_[j] && is_there)) observations.push_back(j);
  }
  const ProblemSubset subset(problem_, std::move(observations));
  Estimate estimate = subset.Restrict(removal_.estimate);
  return BlockSweep(subset.problem(), FastDescentOptions(), bound_.norm,
                    small_context_)
             .IntersectPoints(&estimate) <= bound_.max_error;
}

// A conflict of observation i in its frame and others.
std::optional<Conflict> Packing::Try(int64_t i,
                                     const std::vector<int32_t>& frames) const {
  if (FitsIn(i, frames)) return std::nullopt;
  const std::vector<int64_t> near = Neighbourhood(i, frames);
  for (const std::vector<int64_t>& part :
       SplitIntoComponents(problem_, PruneUnconstrained(problem_, near))) {
    if (!std::binary_search(part.begin(), part.end(), i)) continue;
    const ProblemSubset subset(problem_, part);
    std::vector<int64_t> all(part.size());
    std::iota(all.begin(), all.end(), 0);
    std::optional<Conflict> conflict =
        FindConflict(model_, BuiltPart(built_, subset, built_.start), bound_,
                     all, small_context_);
    if (!conflict) return std::nullopt;
    conflict->observations = subset.InWhole(std::move(conflict->observations));
    conflict->proof.rows = InWhole(subset, std::move(conflict->proof.rows));
    return conflict;
  }
  return std::nullopt;
}

void Packing::Take(Conflict conflict) {
  for (const int64_t i : conflict.observations) {
    is_free_[i] = 0;
    is_taken_[i] = 1;
  }
  conflicts_.push_back(std::move(conflict));
}

// Looks in all the frames' sets at once and takes the first conflict in their
// order.
bool Packing::Charge(int64_t i, int num_others) {
  const std::vector<std::vector<int32_t>> sets = FrameSets(i, num_others);
  std::vector<std::optional<Conflict>> found(sets.size());
  ParallelFor(static_cast<int64_t>(sets.size()), 1, context_.num_threads,
              [&](int64_t n, int64_t, int) { found[n] = Try(i, sets[n]); });
  std::optional<Conflict>* smallest = nullptr;
  for (std::optional<Conflict>& conflict : found) {
    if (conflict &&
        (smallest == nullptr ||
         conflict->observations.size() < (*smallest)->observations.size())) {
      smallest = &conflict;
    }
  }
  if (smallest == nullptr) return false;
  Take(**smallest);
  return true;
}

// Those that are left open found no conflict of their own.
void Packing::Charge(std::vector<std::pair<double, int64_t>>* open) {
  for (const int num_others : {1, 2, 3}) {
    std::vector<std::pair<double, int64_t>> left;
    for (const auto& removed : *open) {
      if (context_.IsCancelled() || IsTaken(removed.second)) continue;
      if (!Charge(removed.second, num_others)) left.push_back(removed);
    }
    *open = std::move(left);
  }
}

std::vector<Conflict> Packing::Run() {
  const Reprojection reprojection(model_, built_);
  std::vector<std::pair<double, int64_t>> open;  // -error, observation
  for (const int64_t i : removal_.observations) {
    open.emplace_back(-reprojection.Error(removal_.estimate, bound_.norm, i),
                      i);
  }
  std::sort(open.begin(), open.end());
  Charge(&open);
  for (const auto& removed : open) is_free_[removed.second] = 1;
  Charge(&open);
  ChargeTight();
  return std::move(conflicts_);
}

void Packing::ChargeTight() {
  std::vector<int64_t> tight;
  for (const int64_t i : removal_.tight) {
    if (is_free_[i]) tight.push_back(i);
  }
  if (tight.empty() || tight.size() > kMaxTight) return;
  const ProblemSubset subset(problem_, tight);
  const BuiltProblem part = BuiltPart(built_, subset, built_.start);
  std::vector<int64_t> all(tight.size());
  std::iota(all.begin(), all.end(), 0);
  for (Conflict& conflict :
       PackConflicts(model_, part, bound_, all, small_context_)) {
    conflict.observations = subset.InWhole(std::move(conflict.observations));
    conflict.proof.rows = InWhole(subset, std::move(conflict.proof.rows));
    Take(std::move(conflict));
  }
}

}  // namespace

std::vector<Conflict> PackAgainstRemoval(const Model& model,
                                         const BuiltProblem& built,
                                         const ErrorBound& bound,
                                         const Removal& removal,
                                         const Context& context) {
  return Packing(model, built, bound, removal, context).Run();
}

}  // namespace krot
