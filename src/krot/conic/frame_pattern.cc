#include "krot/conic/frame_pattern.h"

#include <algorithm>
#include <functional>

namespace krot {
namespace {

// The free frames, numbered; -1: fixed.
std::vector<int32_t> NumberFreeFrames(const BlockStructure& structure) {
  std::vector<int32_t> numbers(structure.num_frames(), -1);
  int32_t num_free = 0;
  for (int64_t f = 0; f < structure.num_frames(); ++f) {
    if (!structure.frame_is_fixed[f]) numbers[f] = num_free++;
  }
  return numbers;
}

}  // namespace

FramePattern FindFramePattern(const BlockStructure& structure) {
  const std::vector<int32_t> numbers = NumberFreeFrames(structure);
  const auto number_of = [&](int64_t i) {
    return numbers[structure.frame_of[i]];
  };
  std::vector<std::vector<int32_t>> points_of(
      std::count(structure.frame_is_fixed.begin(),
                 structure.frame_is_fixed.end(), char{0}));
  for (int64_t k = 0; k < structure.num_points(); ++k) {
    for (int64_t i = structure.point_begin[k]; i < structure.point_begin[k + 1];
         ++i) {
      if (number_of(i) < 0) continue;
      points_of[number_of(i)].push_back(static_cast<int32_t>(k));
    }
  }
  FramePattern pattern(points_of.size());
  std::vector<int32_t> last_met(points_of.size(), -1);  // in whose list it is
  for (int32_t f = 0; f < static_cast<int32_t>(pattern.size()); ++f) {
    pattern[f] = {f};
    last_met[f] = f;
    for (const int32_t k : points_of[f]) {
      for (int64_t i = structure.point_begin[k];
           i < structure.point_begin[k + 1]; ++i) {
        const int32_t other = number_of(i);
        if (other < f || last_met[other] == f) continue;
        last_met[other] = f;
        pattern[f].push_back(other);
      }
    }
    std::sort(pattern[f].begin(), pattern[f].end());
  }
  return pattern;
}

double ShareOfPairs(const FramePattern& pattern, Ranks* ranks) {
  const auto num_frames = static_cast<int64_t>(pattern.size());
  int64_t num_pairs = 0;
  if (ranks == nullptr) {
    for (const std::vector<int32_t>& list : pattern) {
      num_pairs += static_cast<int64_t>(list.size());
    }
  } else {
    std::vector<char> is_there(num_frames * num_frames, 0);
    for (int64_t f = 0; f < num_frames; ++f) {
      for (const int32_t other : pattern[f]) {
        is_there[f * num_frames + other] = 1;
      }
    }
    ranks->Reduce(std::bit_or<char>(), &is_there);
    num_pairs = std::count(is_there.begin(), is_there.end(), char{1});
  }
  return static_cast<double>(num_pairs) /
         (0.5 * static_cast<double>(num_frames * num_frames));
}

void UniteOverRanks(Ranks* ranks, FramePattern* pattern) {
  if (ranks == nullptr) return;
  std::vector<int32_t> pairs;  // both frames in turn
  for (size_t f = 0; f < pattern->size(); ++f) {
    for (const int32_t other : (*pattern)[f]) {
      pairs.push_back(static_cast<int32_t>(f));
      pairs.push_back(other);
    }
    (*pattern)[f].clear();
  }
  pairs = ranks->Gather(pairs);
  for (size_t n = 0; n < pairs.size(); n += 2) {
    (*pattern)[pairs[n]].push_back(pairs[n + 1]);
  }
  for (std::vector<int32_t>& list : *pattern) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
}

}  // namespace krot
