#include "krot/joint/joint.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

// A residual with changed sign, so that sorting puts the worst first, and the
// index of its point or observation.
using Candidate = std::pair<double, int64_t>;

// The median depth, rounded down to a power of two. Ranks can add up counts of
// depths per power of two; the median itself would need all depths.
double CoarseMedianDepth(const KnownRotationProblem& problem,
                         const Estimate& estimate, const Context& context) {
  constexpr int kLowest = std::numeric_limits<double>::min_exponent - 1;
  std::vector<int64_t> count(
      std::numeric_limits<double>::max_exponent - kLowest, 0);
  for (const Observation& observation : problem.observations) {
    const double depth = ViewPoint(problem, observation, estimate).depth;
    if (std::isnormal(depth) && depth > 0) ++count[std::ilogb(depth) - kLowest];
  }
  ReduceRanks(context, std::plus<int64_t>(), &count);
  int64_t left = std::accumulate(count.begin(), count.end(), int64_t{0}) / 2;
  size_t n = 0;
  while (n + 1 < count.size() && left >= count[n]) left -= count[n++];
  return std::ldexp(1.0, static_cast<int>(n) + kLowest);
}

void KeepWorst(int64_t count, std::vector<Candidate>* candidates) {
  if (static_cast<int64_t>(candidates->size()) <= count) return;
  std::nth_element(candidates->begin(), candidates->begin() + count,
                   candidates->end());
  candidates->resize(count);
}

int64_t LengthOf(const KnownRotationProblem& problem, int32_t point) {
  return problem.point_begin[point + 1] - problem.point_begin[point];
}

// One rank's next tracks in the order of Ties. offer[0] is 1 if the rank has no
// more tracks after these, otherwise 0; then follow, for each track, its length
// and its frames.
using Offer = std::vector<int32_t>;

// Reads the tracks of an offer one after the other.
struct Reader {
  const Offer& offer;
  size_t next = 1;

  bool HasMore() const { return next < offer.size(); }
  bool IsAll() const { return offer[0] != 0; }
  int32_t Length() const { return offer[next]; }
  Range<const int32_t*> Frames() const {
    return {&offer[next] + 1, &offer[next] + 1 + Length()};
  }
  void Advance() { next += 1 + static_cast<size_t>(Length()); }
};

// Chooses points of `others`, which ascend, that tie frames to the working set.
// Goes through them by falling length of their tracks and takes every point
// that is seen by a frame with fewer than `count` observations so far: those of
// `tied`, per frame, and those of the points taken before. Where ranks share
// the points, each gets its share of the points that one process would take.
class Ties {
 public:
  Ties(const KnownRotationProblem& problem, std::vector<int32_t> others,
       int count, std::vector<int64_t> tied)
      : problem_(problem),
        others_(std::move(others)),
        count_(count),
        tied_(std::move(tied)) {
    std::stable_sort(others_.begin(), others_.end(), [&](int32_t a, int32_t b) {
      return LengthOf(problem, a) > LengthOf(problem, b);
    });
  }

  // All ranks must call it, with the same `tied`.
  std::vector<int32_t> Find(const Context& context) {
    for (;;) {
      const Offer own = MakeOffer();
      const bool is_any_left =
          context.ranks == nullptr
              ? Decide({own}, 0)
              : Decide(context.ranks->ExchangeValues(
                           std::vector<Offer>(context.ranks->count(), own)),
                       context.ranks->rank());
      if (!is_any_left) return std::move(taken_);
    }
  }

 private:
  bool IsMissing(int32_t frame) const { return tied_[frame] < count_; }

  // Offers only tracks with a frame that still needs ties. The others are
  // dropped for good, as the number of ties never falls.
  Offer MakeOffer() {
    Offer offer = {0};
    const auto add = [&](int32_t k) {
      const size_t begin = offer.size();
      offer.push_back(static_cast<int32_t>(LengthOf(problem_, k)));
      bool is_missing = false;
      for (const int64_t i : problem_.OfPoint(k)) {
        offer.push_back(problem_.FrameOf(i));
        is_missing |= IsMissing(offer.back());
      }
      if (!is_missing) offer.resize(begin);
      return is_missing;
    };
    offered_.erase(std::remove_if(offered_.begin(), offered_.end(),
                                  [&](int32_t k) { return !add(k); }),
                   offered_.end());
    while (next_ < others_.size() && offered_.size() < 2048) {
      const int32_t k = others_[next_++];
      if (add(k)) offered_.push_back(k);
    }
    offer[0] = next_ == others_.size() ? 1 : 0;
    return offer;
  }

  // Takes or rejects the tracks of all ranks' offers, as long as it is known
  // which track comes next: the longest of all offers, and of equal lengths
  // that of the lower rank. Once the offer of a rank that has more tracks is
  // used up, it is unknown. Returns whether any are left.
  bool Decide(const std::vector<Offer>& offers, int rank) {
    std::vector<Reader> readers;
    for (const Offer& offer : offers) readers.push_back({offer});
    size_t num_decided = 0;  // of those offered here
    for (;;) {
      Reader* longest = nullptr;
      for (Reader& reader : readers) {
        if (!reader.HasMore() && reader.IsAll()) continue;
        if (!reader.HasMore()) {
          offered_.erase(offered_.begin(), offered_.begin() + num_decided);
          return true;
        }
        if (longest == nullptr || reader.Length() > longest->Length()) {
          longest = &reader;
        }
      }
      if (longest == nullptr) return false;
      const Range<const int32_t*> frames = longest->Frames();
      const bool is_here = longest == &readers[rank];
      if (std::any_of(frames.begin(), frames.end(),
                      [&](int32_t f) { return IsMissing(f); })) {
        for (const int32_t f : frames) ++tied_[f];
        if (is_here) taken_.push_back(offered_[num_decided]);
      }
      if (is_here) ++num_decided;
      longest->Advance();
    }
  }

  const KnownRotationProblem& problem_;
  std::vector<int32_t> others_;
  const int count_;
  std::vector<int64_t> tied_;     // per frame
  std::vector<int32_t> offered_;  // undecided points of this rank
  size_t next_ = 0;               // of others_
  std::vector<int32_t> taken_;
};

}  // namespace

WorkingSet::WorkingSet(const KnownRotationProblem& problem,
                       const Context& context)
    : problem_(problem),
      context_(context),
      contains_(problem.num_points, 0),
      takes_(problem.observations.size(), 0),
      num_observations_of_whole_(SumOfRanks(
          context, static_cast<int64_t>(problem.observations.size()))) {
  if (context.ranks != nullptr) {
    first_point_ = context.ranks->SumBefore(problem.num_points);
  }
}

void WorkingSet::Take(int64_t observation) {
  char& takes = takes_[observation];
  num_observations_here_ += 1 - takes;
  takes = 1;
  char& contains = contains_[problem_.observations[observation].point];
  num_points_here_ += 1 - contains;
  contains = 1;
}

void WorkingSet::CountTaken() {
  num_points_ = SumOfRanks(context_, num_points_here_);
  num_observations_ = SumOfRanks(context_, num_observations_here_);
}

// The largest residual of the point's observations outside of the set; 0 if
// there are none.
double WorkingSet::LargestOutside(const std::vector<AffineMap>& cameras,
                                  const Estimate& estimate, Norm norm,
                                  int32_t k) const {
  double largest = 0;
  for (const int64_t i : problem_.OfPoint(k)) {
    if (takes_[i] != 0) continue;
    const Observation& o = problem_.observations[i];
    largest = std::max(
        largest,
        ResidualOf(ViewPoint(cameras[o.view], o, estimate.points[k]), norm));
  }
  return largest;
}

int64_t WorkingSet::AddAbove(const Estimate& estimate, Norm norm, double level,
                             int64_t max_points, double share) {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem_, estimate.translations);
  std::vector<double> outside(problem_.num_points);
  ParallelForEach(problem_.num_points, context_.num_threads, [&](int64_t k) {
    outside[k] =
        LargestOutside(cameras, estimate, norm, static_cast<int32_t>(k));
  });
  std::vector<Candidate> above;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (outside[k] > level) above.emplace_back(-outside[k], first_point_ + k);
  }
  KeepWorst(max_points, &above);
  if (context_.ranks != nullptr) {
    above = context_.ranks->Gather(above);
    KeepWorst(max_points, &above);
  }
  std::vector<Candidate> residuals;  // of a point
  for (const Candidate& worst : above) {
    const int64_t k = worst.second - first_point_;
    if (k < 0 || k >= problem_.num_points) continue;
    residuals.clear();
    for (const int64_t i : problem_.OfPoint(k)) {
      const Observation& o = problem_.observations[i];
      residuals.emplace_back(
          -ResidualOf(ViewPoint(cameras[o.view], o, estimate.points[k]), norm),
          i);
    }
    std::sort(residuals.begin(), residuals.end());
    for (size_t n = 0; n < residuals.size(); ++n) {
      // With fewer than four, the point's others would soon exceed the level.
      if (n >= 4 && -residuals[n].first < share * level) break;
      Take(residuals[n].second);
    }
  }
  CountTaken();
  return static_cast<int64_t>(above.size());
}

void WorkingSet::AddTies(int count) {
  std::vector<int64_t> tied(problem_.num_frames, 0);
  for (const int64_t i : Observations()) {
    ++tied[problem_.FrameOf(i)];
  }
  ReduceRanks(context_, std::plus<int64_t>(), &tied);
  std::vector<int32_t> others;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    const auto begin = takes_.begin() + problem_.point_begin[k];
    const auto end = takes_.begin() + problem_.point_begin[k + 1];
    if (std::find(begin, end, 0) != end) others.push_back(k);
  }
  Ties ties(problem_, std::move(others), count, std::move(tied));
  for (const int32_t k : ties.Find(context_)) TakePoint(k);
  CountTaken();
}

void WorkingSet::TakePoint(int32_t point) {
  for (const int64_t i : problem_.OfPoint(point)) {
    Take(i);
  }
}

void WorkingSet::AddPoint(int32_t point) {
  TakePoint(point);
  CountTaken();
}

void WorkingSet::AddAll() {
  for (size_t i = 0; i < takes_.size(); ++i) Take(static_cast<int64_t>(i));
  CountTaken();
}

std::vector<int64_t> WorkingSet::Observations() const {
  return IndicesWhere(SignedSize(takes_),
                      [&](int64_t i) { return takes_[i] != 0; });
}

double WorkingSet::Cost(const Estimate& estimate, Norm norm) const {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem_, estimate.translations);
  double cost = 0;
  for (size_t i = 0; i < takes_.size(); ++i) {
    if (takes_[i] == 0) continue;
    const Observation& o = problem_.observations[i];
    cost = std::max(cost, ResidualOf(ViewPoint(cameras[o.view], o,
                                               estimate.points[o.point]),
                                     norm));
  }
  return MaxOfRanks(context_, cost);
}

double LongestBaseline(const KnownRotationProblem& problem) {
  double longest = 0;
  for (const View& view : problem.views) {
    longest = std::max(longest, view.cam_from_rig_translation.norm());
  }
  return longest;
}

double ShareOfLevel(const KnownRotationProblem& problem,
                    const Estimate& estimate, const Context& context) {
  const bool is_tiny =
      HasBaseline(problem) &&
      LongestBaseline(problem) <
          kTinyBaseline * CoarseMedianDepth(problem, estimate, context);
  return is_tiny ? 0 : 0.7;
}

WorkingSet FirstWorkingSet(const KnownRotationProblem& problem,
                           const Estimate& estimate, Norm norm, double cost,
                           const Context& context) {
  WorkingSet set(problem, context);
  set.AddAbove(estimate, norm, 0.9 * cost, std::numeric_limits<int64_t>::max(),
               ShareOfLevel(problem, estimate, context));
  set.AddTies(20);
  return set;
}

}  // namespace krot::internal
