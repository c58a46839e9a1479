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

// Pairs are marked in a matrix of bits, of as many rows at a time as there is
// room for: points are gone through in their order, once for each time.
FramePattern FindFramePattern(const BlockStructure& structure,
                              int64_t most_words) {
  const std::vector<int32_t> numbers = NumberFreeFrames(structure);
  const int64_t num_free = std::count(structure.frame_is_fixed.begin(),
                                      structure.frame_is_fixed.end(), char{0});
  const int64_t words_per_row = num_free / 64 + 1;
  const int64_t rows_at_a_time =
      std::min(num_free, std::max<int64_t>(1, most_words / words_per_row));
  FramePattern pattern(num_free);
  std::vector<uint64_t> bits;
  std::vector<int64_t> seeing;  // free frames
  for (int64_t first = 0; first < num_free; first += rows_at_a_time) {
    const int64_t behind = std::min(first + rows_at_a_time, num_free);
    bits.assign((behind - first) * words_per_row, 0);
    const auto row_of = [&](int64_t f) {
      return bits.data() + (f - first) * words_per_row;
    };
    for (int64_t k = 0; k < structure.num_points(); ++k) {
      seeing.clear();
      for (int64_t i = structure.point_begin[k];
           i < structure.point_begin[k + 1]; ++i) {
        const int32_t f = numbers[structure.frame_of[i]];
        if (f >= first) seeing.push_back(f);
      }
      for (const int64_t f : seeing) {
        if (f >= behind) continue;
        uint64_t* const row = row_of(f);
        for (const int64_t other : seeing) {
          row[other / 64] |= uint64_t{1} << (other % 64);
        }
      }
    }
    for (int64_t f = first; f < behind; ++f) {
      pattern[f] = {static_cast<int32_t>(f)};
      const uint64_t* const row = row_of(f);
      for (int64_t other = f + 1; other < num_free; ++other) {
        const uint64_t rest = row[other / 64] >> (other % 64);
        if (rest == 0) {
          other |= 63;  // none in this word
        } else if ((rest & 1) != 0) {
          pattern[f].push_back(static_cast<int32_t>(other));
        }
      }
    }
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
