#include "krot/outliers/parts.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "krot/base/disjoint_sets.h"
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
    for (const int32_t frame : frames) sights_.push_back({frame, 1});
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
  std::vector<int64_t> num_shared(sizes_.size(), 0);
  std::vector<int32_t> sharing;
  for (int32_t a = 0; a < static_cast<int32_t>(sizes_.size()); ++a) {
    sharing.clear();
    for (const int32_t k : tracks_of[a]) {
      for (int64_t n = begin_[k + 1] - 1; sights_[n].group > a; --n) {
        const int32_t b = sights_[n].group;
        if (num_shared[b]++ == 0) sharing.push_back(b);
      }
    }
    for (const int32_t b : sharing) {
      pairs.push_back(
          {a, b, static_cast<double>(std::exchange(num_shared[b], 0))});
    }
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
      const auto [group, own] = sights_[n];
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

bool IsStronger(const GroupPair& x, const GroupPair& y) {
  return std::make_tuple(-x.strength, x.a, x.b) <
         std::make_tuple(-y.strength, y.a, y.b);
}

// Keeps of all pairs the strongest of each group.
void KeepStrongest(size_t num_groups, std::vector<GroupPair>* pairs) {
  std::vector<const GroupPair*> strongest(num_groups, nullptr);
  for (const GroupPair& pair : *pairs) {
    for (const int32_t group : {pair.a, pair.b}) {
      const GroupPair*& own = strongest[group];
      if (own == nullptr || IsStronger(pair, *own)) own = &pair;
    }
  }
  std::vector<GroupPair> kept;
  for (const GroupPair& pair : *pairs) {
    if (strongest[pair.a] == &pair || strongest[pair.b] == &pair) {
      kept.push_back(pair);
    }
  }
  *pairs = std::move(kept);
}

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
  std::sort(pairs->begin(), pairs->end(), IsStronger);
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
    const auto is_open = [&](int32_t group) {
      const auto [num_tracks, num_shared, num_located] = counts[group];
      const bool is_loose =
          num_tracks < options.min_tracks && num_tracks < num_located;
      return sizes[group] == 1 || is_loose ||
             (num_shared >= options.min_tracks &&
              (!options.compares_scales || num_located >= options.min_tracks) &&
              static_cast<double>(num_shared) >=
                  options.min_share * static_cast<double>(num_tracks));
    };
    std::vector<GroupPair> pairs = groups.Pairs();
    for (GroupPair& pair : pairs) {
      pair.strength /= static_cast<double>(std::max<int64_t>(
          1, std::min(counts[pair.a].num_tracks, counts[pair.b].num_tracks)));
    }
    KeepStrongest(sizes.size(), &pairs);
    SortStrongestFirst(&pairs);
    // In each pass a group is united with at most one other, because the tracks
    // that it shares change by that.
    std::vector<char> has_best(problem.num_frames, 0);
    std::vector<char> is_done(problem.num_frames, 0);
    goes_on = false;
    for (const auto& [a, b, strength] : pairs) {
      const bool is_best =
          (is_open(a) && !has_best[a]) || (is_open(b) && !has_best[b]);
      has_best[a] = has_best[b] = 1;
      if (!is_best || is_done[a] || is_done[b]) continue;
      is_done[a] = is_done[b] = 1;
      sets.Unite(a, b);
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
  std::vector<int64_t> ties;
  for (int64_t i = 0; i < count; ++i) {
    if (agrees[i] || num_agreeing[problem.FrameOf(i)] < 6) ties.push_back(i);
  }
  const ProblemSubset subset(problem, std::move(ties));
  const KnownRotationProblem& own = subset.problem();
  const std::vector<int32_t> parts = FindParts(own, options);
  std::vector<int32_t> part_of(problem.num_frames);
  for (int64_t i = 0; i < static_cast<int64_t>(own.observations.size()); ++i) {
    part_of[problem.FrameOf(subset.InWhole(i))] = parts[own.FrameOf(i)];
  }
  NumberInOrder(&part_of);
  return part_of;
}

}  // namespace krot::internal
