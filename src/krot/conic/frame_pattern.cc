#include "krot/conic/frame_pattern.h"

#include <algorithm>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

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

using PatternMatrix = Eigen::SparseMatrix<double>;

// Eigen counts, and keeps it to itself.
class SymbolicFactor : private Eigen::SimplicialLLT<PatternMatrix, Eigen::Lower,
                                                    Eigen::AMDOrdering<int>> {
 public:
  explicit SymbolicFactor(const PatternMatrix& matrix) {
    analyzePattern(matrix);
  }

  // Of each column, below the diagonal.
  const Eigen::VectorXi& counts() const { return m_nonZerosPerCol; }
};

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

SparseFactorSize FindSparseFactorSize(const FramePattern& pattern) {
  const auto num_frames = static_cast<Eigen::Index>(pattern.size());
  PatternMatrix matrix(num_frames, num_frames);
  Eigen::VectorXi sizes(num_frames);
  for (Eigen::Index f = 0; f < num_frames; ++f) {
    sizes[f] = static_cast<int>(pattern[f].size());
  }
  matrix.reserve(sizes);
  for (Eigen::Index f = 0; f < num_frames; ++f) {
    for (const int32_t other : pattern[f]) matrix.insert(other, f) = 1;
  }
  matrix.makeCompressed();
  SparseFactorSize size = {0, 0};
  const SymbolicFactor factor(matrix);
  for (const int count : factor.counts()) {
    for (int64_t below : {3 * count, 3 * count + 1, 3 * count + 2}) {
      size.numbers += below + 1;
      size.operations += static_cast<double>(below * below);
    }
  }
  return size;
}

}  // namespace krot
