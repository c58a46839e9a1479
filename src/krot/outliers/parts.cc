#include "krot/outliers/parts.h"

#include <algorithm>
#include <tuple>
#include <unordered_map>

#include "krot/base/disjoint_sets.h"

namespace krot::internal {

template <typename Visit>
void Groups::ForEachTrack(const Visit& visit) const {
  std::vector<std::pair<int32_t, int32_t>> seen;  // group, frame
  std::vector<std::pair<int32_t, int32_t>> groups;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    seen.clear();
    for (int64_t i = problem_.point_begin[k]; i < problem_.point_begin[k + 1];
         ++i) {
      const int32_t frame = FrameOf(problem_, i);
      seen.emplace_back(group_of_[frame], frame);
    }
    std::sort(seen.begin(), seen.end());
    seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
    groups.clear();
    for (const auto& [group, frame] : seen) {
      if (groups.empty() || groups.back().first != group) {
        groups.emplace_back(group, 0);
      }
      ++groups.back().second;
    }
    visit(groups);
  }
}

std::vector<GroupPair> Groups::Pairs() const {
  std::unordered_map<uint64_t, int64_t> shared;
  ForEachTrack([&](const std::vector<std::pair<int32_t, int32_t>>& groups) {
    for (size_t a = 0; a < groups.size(); ++a) {
      for (size_t b = a + 1; b < groups.size(); ++b) {
        ++shared[static_cast<uint64_t>(groups[a].first) << 32 |
                 static_cast<uint32_t>(groups[b].first)];
      }
    }
  });
  std::vector<GroupPair> pairs;
  for (const auto& [key, count] : shared) {
    pairs.push_back({static_cast<int32_t>(key >> 32),
                     static_cast<int32_t>(key & 0xffffffffu),
                     static_cast<double>(count)});
  }
  return pairs;
}

std::vector<Groups::Count> Groups::Counts(bool compares_scales) const {
  const std::vector<int32_t> sizes = Sizes();
  std::vector<Count> counts(sizes.size());
  ForEachTrack([&](const std::vector<std::pair<int32_t, int32_t>>& groups) {
    int32_t num_frames = 0;
    for (const auto& [group, count] : groups) num_frames += count;
    for (const auto& [group, count] : groups) {
      if (count < std::min(2, sizes[group])) continue;
      ++counts[group].num_tracks;
      counts[group].num_shared +=
          num_frames - count >= (compares_scales ? 2 : 1);
    }
  });
  return counts;
}

void SortStrongestFirst(std::vector<GroupPair>* pairs) {
  std::sort(pairs->begin(), pairs->end(),
            [](const GroupPair& x, const GroupPair& y) {
              return std::make_tuple(-x.strength, x.a, x.b) <
                     std::make_tuple(-y.strength, y.a, y.b);
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
  for (bool goes_on = true; goes_on;) {
    find_all();
    const Groups groups(problem, part_of);
    const std::vector<int32_t> sizes = groups.Sizes();
    const std::vector<Groups::Count> counts =
        groups.Counts(options.compares_scales);
    const auto is_open = [&](int32_t group) {
      const auto [num_tracks, num_shared] = counts[group];
      return sizes[group] == 1 ||
             (num_shared >= options.min_tracks &&
              static_cast<double>(num_shared) >=
                  options.min_share * static_cast<double>(num_tracks));
    };
    std::vector<GroupPair> pairs = groups.Pairs();
    for (GroupPair& pair : pairs) {
      pair.strength /= static_cast<double>(std::max<int64_t>(
          1, std::min(counts[pair.a].num_tracks, counts[pair.b].num_tracks)));
    }
    SortStrongestFirst(&pairs);
    // Each becomes one with at most one other at a time, as it has other tracks
    // in common afterwards.
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
  }
  std::vector<int32_t> number(problem.num_frames, -1);
  int32_t count = 0;
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    int32_t& own = number[part_of[f]];
    if (own < 0) own = count++;
    part_of[f] = own;
  }
  return part_of;
}

}  // namespace krot::internal
