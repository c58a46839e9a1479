#include "krot/outliers/parts.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "krot/analysis/noise.h"
#include "krot/base/numbers.h"
#include "krot/finish/least_squares.h"
#include "krot/outliers/robust_start.h"
#include "krot/problem/subset.h"

namespace krot::internal {

Groups::Groups(const KnownRotationProblem& problem,
               const std::vector<int32_t>& group_of)
    : sizes_(problem.num_frames, 1), begin_{0} {
  std::vector<int32_t> frames;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    frames.clear();
    for (const int64_t i : problem.OfPoint(k)) {
      frames.push_back(problem.FrameOf(i));
    }
    SortUnique(&frames);
    for (const int32_t frame : frames) sights_.push_back({frame, 1, frame});
    begin_.push_back(static_cast<int64_t>(sights_.size()));
  }
  Merge(group_of);
}

void Groups::Merge(const std::vector<int32_t>& new_group) {
  std::vector<int32_t> sizes(sizes_.size(), 0);
  for (size_t g = 0; g < sizes.size(); ++g) sizes[new_group[g]] += sizes_[g];
  sizes_ = std::move(sizes);
  std::vector<Sight> track;
  int64_t end = 0;  // of what has been merged
  for (size_t k = 0; k + 1 < begin_.size(); ++k) {
    track.assign(sights_.begin() + begin_[k], sights_.begin() + begin_[k + 1]);
    for (Sight& sight : track) sight.group = new_group[sight.group];
    std::sort(track.begin(), track.end(),
              [](const Sight& a, const Sight& b) { return a.group < b.group; });
    const int64_t begin = begin_[k] = end;
    for (const Sight& sight : track) {
      if (end > begin && sights_[end - 1].group == sight.group) {
        sights_[end - 1].num_frames += sight.num_frames;
      } else {
        sights_[end++] = sight;
      }
    }
  }
  begin_.back() = end;
  sights_.resize(end);
}

std::vector<GroupPair> Groups::Pairs() const {
  std::vector<std::vector<int32_t>> tracks_of(sizes_.size());
  for (size_t k = 0; k + 1 < begin_.size(); ++k) {
    for (int64_t n = begin_[k]; n + 1 < begin_[k + 1]; ++n) {
      tracks_of[sights_[n].group].push_back(static_cast<int32_t>(k));
    }
  }
  std::vector<GroupPair> pairs;
  std::vector<int32_t> pair_of(sizes_.size());  // with group a, in `pairs`
  // The pair and the frame of each tying track that only one frame of one of
  // the groups sees.
  std::vector<std::pair<int32_t, int32_t>> located;
  for (int32_t a = 0; a < static_cast<int32_t>(sizes_.size()); ++a) {
    const auto begin = static_cast<int32_t>(pairs.size());
    located.clear();
    for (const int32_t k : tracks_of[a]) {
      const Sight* const of_a =
          std::lower_bound(&sights_[begin_[k]], &sights_[begin_[k + 1]], a,
                           [](const Sight& sight, int32_t group) {
                             return sight.group < group;
                           });
      for (const Sight* of_b = of_a + 1; of_b < &sights_[begin_[k + 1]];
           ++of_b) {
        const int32_t b = of_b->group;
        int32_t& n = pair_of[b];
        if (n < begin || n >= static_cast<int32_t>(pairs.size()) ||
            pairs[n].b != b) {
          n = static_cast<int32_t>(pairs.size());
          pairs.push_back({a, b});
        }
        ++pairs[n].num_tracks;
        const auto [fewer, more] =
            std::minmax(of_a->num_frames, of_b->num_frames);
        if (more < std::min(2, std::max(sizes_[a], sizes_[b]))) continue;
        ++pairs[n].num_tying;
        if (fewer == 1 && sizes_[a] > 1 && sizes_[b] > 1) {
          located.emplace_back(
              n, of_a->num_frames == 1 ? of_a->frame : of_b->frame);
        }
      }
    }
    std::sort(located.begin(), located.end());
    for (auto first = located.begin(); first != located.end();) {
      const auto pair = first->first;
      std::ptrdiff_t most = 0;
      while (first != located.end() && first->first == pair) {
        const auto last = std::upper_bound(first, located.end(), *first);
        most = std::max(most, last - first);
        first = last;
      }
      pairs[pair].num_tying -= most;
    }
  }
  for (GroupPair& pair : pairs) {
    pair.strength = static_cast<double>(pair.num_tracks);
  }
  return pairs;
}

std::vector<Groups::Count> Groups::Counts() const {
  std::vector<Count> counts(sizes_.size());
  for (size_t k = 0; k + 1 < begin_.size(); ++k) {
    int32_t num_frames = 0;
    for (int64_t n = begin_[k]; n < begin_[k + 1]; ++n) {
      num_frames += sights_[n].num_frames;
    }
    for (int64_t n = begin_[k]; n < begin_[k + 1]; ++n) {
      const auto [group, own, frame] = sights_[n];
      const int32_t others = num_frames - own;
      counts[group].num_located += others >= 2;
      if (own < std::min(2, sizes_[group])) continue;
      ++counts[group].num_tracks;
      counts[group].num_shared += others >= 1;
    }
  }
  return counts;
}

namespace {

// Numbers parts from 0 in the order of their first frames.
void NumberInOrder(std::vector<int32_t>* part_of) {
  const int32_t most = *std::max_element(part_of->begin(), part_of->end());
  std::vector<int32_t> number(most + 1, -1);
  int32_t count = 0;
  for (int32_t& part : *part_of) {
    int32_t& own = number[part];
    if (own < 0) own = count++;
    part = own;
  }
}

}  // namespace

void SortStrongestFirst(std::vector<GroupPair>* pairs) {
  std::sort(pairs->begin(), pairs->end(),
            [](const GroupPair& x, const GroupPair& y) {
              return std::make_tuple(-x.strength, -x.num_tracks, x.a, x.b) <
                     std::make_tuple(-y.strength, -y.num_tracks, y.a, y.b);
            });
}

std::vector<int32_t> FindParts(const KnownRotationProblem& problem,
                               const PartOptions& options) {
  DisjointSets sets(problem.num_frames);
  std::vector<int32_t> part_of(problem.num_frames);
  const auto find_all = [&] {
    for (int32_t f = 0; f < problem.num_frames; ++f) {
      part_of[f] = static_cast<int32_t>(sets.Find(f));
    }
  };
  find_all();
  Groups groups(problem, part_of);
  for (bool goes_on = true; goes_on;) {
    const std::vector<int32_t>& sizes = groups.sizes();
    const std::vector<Groups::Count> counts = groups.Counts();
    std::vector<GroupPair> pairs = groups.Pairs();
    const auto is_tied = [&](int32_t group, const GroupPair& pair) {
      const auto [num_tracks, num_shared, num_located] = counts[group];
      if (sizes[group] == 1 ||
          (num_tracks < options.min_tracks && num_tracks < num_located)) {
        return true;
      }
      return options.compares_scales
                 ? pair.num_tying >= options.min_tracks
                 : num_shared >= options.min_tracks &&
                       static_cast<double>(num_shared) >=
                           options.min_share * static_cast<double>(num_tracks);
    };
    for (GroupPair& pair : pairs) {
      const int64_t num_tracks =
          options.compares_scales ? pair.num_tying : pair.num_tracks;
      pair.strength = static_cast<double>(num_tracks) /
                      static_cast<double>(std::max<int64_t>(
                          1, std::min(counts[pair.a].num_tracks,
                                      counts[pair.b].num_tracks)));
    }
    SortStrongestFirst(&pairs);
    // Unites every group by the first pair that ties it. As what it shares
    // changes by that, in each pass a group is united with one other, or with
    // any number of smaller ones that it ties.
    enum class Pass : char { kFree, kTakesSmaller, kIsUnited };
    std::vector<Pass> in_pass(problem.num_frames, Pass::kFree);
    std::vector<char> has_best(problem.num_frames, 0);
    goes_on = false;
    for (const GroupPair& pair : pairs) {
      const auto [smaller, larger] = sizes[pair.a] < sizes[pair.b]
                                         ? std::pair(pair.a, pair.b)
                                         : std::pair(pair.b, pair.a);
      const auto is_best_of = [&](int32_t group) {
        if (has_best[group]) return false;
        has_best[group] = is_tied(group, pair);
        return has_best[group] != 0;
      };
      const bool is_best_of_larger = is_best_of(larger);
      const bool is_best_of_smaller = is_best_of(smaller);
      const bool is_possible = in_pass[larger] == Pass::kFree
                                   ? is_best_of_larger || is_best_of_smaller
                                   : in_pass[larger] == Pass::kTakesSmaller &&
                                         is_best_of_smaller &&
                                         sizes[smaller] < sizes[larger];
      if (!is_possible || in_pass[smaller] != Pass::kFree) continue;
      in_pass[smaller] = Pass::kIsUnited;
      in_pass[larger] = sizes[smaller] < sizes[larger] ? Pass::kTakesSmaller
                                                       : Pass::kIsUnited;
      sets.Unite(smaller, larger);
      goes_on = true;
    }
    find_all();
    groups.Merge(part_of);
  }
  NumberInOrder(&part_of);
  return part_of;
}

std::vector<int32_t> FindParts(const KnownRotationProblem& problem,
                               const std::vector<char>& agrees,
                               const PartOptions& options) {
  std::vector<int32_t> num_agreeing(problem.num_frames, 0);
  const auto count = static_cast<int64_t>(agrees.size());
  for (int64_t i = 0; i < count; ++i) {
    num_agreeing[problem.FrameOf(i)] += agrees[i];
  }
  const ProblemSubset subset(problem, IndicesWhere(count, [&](int64_t i) {
                               return agrees[i] ||
                                      num_agreeing[problem.FrameOf(i)] < 6;
                             }));
  const KnownRotationProblem& own = subset.problem();
  const std::vector<int32_t> parts = FindParts(own, options);
  std::vector<int32_t> part_of(problem.num_frames);
  for (int64_t i = 0; i < static_cast<int64_t>(own.observations.size()); ++i) {
    part_of[problem.FrameOf(subset.InWhole(i))] = parts[own.FrameOf(i)];
  }
  NumberInOrder(&part_of);
  return part_of;
}

std::vector<double> SquaredErrorsAt(const KnownRotationProblem& problem,
                                    const Estimate& estimate) {
  std::vector<double> squared;
  for (const Observation& o : problem.observations) {
    const double error =
        ResidualOf(ViewPoint(problem, o, estimate), Norm::L2());
    squared.push_back(error * error);
  }
  return squared;
}

double NoiseOf(const KnownRotationProblem& problem, const Estimate& estimate,
               const std::function<bool(int64_t i)>& counts) {
  std::vector<double> squared = SquaredErrorsAt(problem, estimate);
  ShareErrorsOfPairs(problem, &squared);
  std::vector<double> errors;
  for (size_t n = 0; n < problem.observations.size(); ++n) {
    const int32_t k = problem.observations[n].point;
    const auto rows = 2.0 * static_cast<double>(problem.point_begin[k + 1] -
                                                problem.point_begin[k]);
    if (rows <= 3 || !counts(static_cast<int64_t>(n))) continue;
    errors.push_back(std::sqrt(squared[n] * rows / (rows - 3)));
  }
  if (errors.empty()) return kLeastNoisePx;
  return std::max(kLeastNoisePx,
                  Median(std::move(errors)) / std::sqrt(2 * std::log(2.0)));
}

std::optional<WeakLink> FindSoftPart(const KnownRotationProblem& problem,
                                     const Estimate& estimate,
                                     const std::vector<char>& kept, double cap,
                                     const Context& context) {
  const ProblemSubset subset(
      problem, IndicesWhere(static_cast<int64_t>(kept.size()),
                            [&](int64_t i) { return kept[i] != 0; }));
  const KnownRotationProblem& own = subset.problem();
  if (own.observations.empty()) return std::nullopt;
  Estimate placed = subset.Restrict(estimate);
  PlacePointsRobustly(own, AllPoints(own), Norm::L2(), cap, context, &placed);
  const auto [changes, deviation] = FindSoftestMotion(
      own, placed, NoiseOf(own, placed, [](int64_t) { return true; }), context);
  double least = kInfinity, most = -kInfinity;
  for (const std::optional<double>& change : changes) {
    least = std::min(least, change.value_or(least));
    most = std::max(most, change.value_or(most));
  }
  if (!(most > least)) return std::nullopt;
  WeakLink link;
  link.scale_factor = 1 + 3 * deviation * (most - least);
  if (link.scale_factor > kLargestScale) link.scale_factor = kInfinity;
  // The side with fewer frames.
  std::vector<int32_t> own_frame(problem.num_frames, -1);
  for (size_t i = 0; i < own.observations.size(); ++i) {
    const auto n = static_cast<int64_t>(i);
    own_frame[problem.FrameOf(subset.InWhole(n))] = own.FrameOf(n);
  }
  std::vector<int32_t> sides[2];
  std::vector<char> side_of(problem.num_frames, 2);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (own_frame[f] < 0 || !changes[own_frame[f]]) continue;
    const int side = 2 * *changes[own_frame[f]] > least + most ? 1 : 0;
    side_of[f] = static_cast<char>(side);
    sides[side].push_back(f);
  }
  link.frames = sides[sides[1].size() <= sides[0].size()];
  for (int32_t k = 0; k < problem.num_points; ++k) {
    bool sees[3] = {}, agrees[3] = {};
    int32_t count = 0;  // of the sides' observations
    for (const int64_t i : problem.OfPoint(k)) {
      const int side = side_of[problem.FrameOf(i)];
      sees[side] = true;
      agrees[side] = agrees[side] || kept[i];
      count += side < 2;
    }
    link.num_tracks += sees[0] && sees[1];
    link.num_of_three += sees[0] && sees[1] && count > 2;
    link.num_agreeing += agrees[0] && agrees[1];
  }
  link.num_telling = link.num_agreeing;  // the others are not kept
  return link;
}

}  // namespace krot::internal
