#include "krot/linear/blocks.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

namespace krot::internal {
namespace {

using PatternMatrix = Eigen::SparseMatrix<double>;

// Eigen counts the numbers of each column below the diagonal, but does not
// publish the counts.
class SymbolicFactor : private Eigen::SimplicialLLT<PatternMatrix, Eigen::Lower,
                                                    Eigen::AMDOrdering<int>> {
 public:
  explicit SymbolicFactor(const PatternMatrix& matrix) {
    analyzePattern(matrix);
  }
  const Eigen::VectorXi& counts() const { return m_nonZerosPerCol; }
};

// Per frame, its number among the free frames; -1 if it is fixed.
std::vector<int32_t> NumberFreeFrames(const BlockStructure& structure) {
  std::vector<int32_t> numbers(structure.num_frames(), -1);
  int32_t num_free = 0;
  for (int64_t f = 0; f < structure.num_frames(); ++f) {
    if (!structure.frame_is_fixed[f]) numbers[f] = num_free++;
  }
  return numbers;
}

// Per free frame, by number, the points that it sees.
std::vector<std::vector<int32_t>> PointsOfFrames(
    const BlockStructure& structure, const std::vector<int32_t>& numbers) {
  std::vector<std::vector<int32_t>> points(structure.num_frames());
  for (int32_t k = 0; k < structure.num_points(); ++k) {
    for (int64_t i = structure.point_begin[k]; i < structure.point_begin[k + 1];
         ++i) {
      const int32_t number = numbers[structure.frame_of[i]];
      if (number >= 0) points[number].push_back(k);
    }
  }
  return points;
}

// Replaces the pattern by the union of all ranks' patterns.
void UniteOverRanks(Ranks* ranks, BlockPattern* pattern) {
  std::vector<std::pair<int32_t, int32_t>> pairs;  // column and row
  const int32_t num_columns = pattern->num_columns();
  for (int32_t j = 0; j < num_columns; ++j) {
    for (int64_t n = pattern->begin[j]; n < pattern->begin[j + 1]; ++n) {
      pairs.emplace_back(j, pattern->row[n]);
    }
  }
  pairs = ranks->Gather(pairs);
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  *pattern = {};
  for (const auto& [column, row] : pairs) {
    if (row == column) pattern->begin.push_back(0);
    pattern->row.push_back(row);
    pattern->begin.back() = pattern->num_blocks();
  }
}

}  // namespace

std::vector<int32_t> OrderByFrame(const BlockStructure& structure) {
  std::vector<int32_t> order;
  order.reserve(structure.num_observations());
  for (int64_t k = 0; k < structure.num_points(); ++k) {
    const int64_t begin = structure.point_begin[k];
    const int64_t end = structure.point_begin[k + 1];
    for (int64_t i = begin; i < end; ++i) {
      order.push_back(static_cast<int32_t>(i - begin));
    }
    std::sort(order.begin() + begin, order.end(), [&](int32_t a, int32_t b) {
      const int32_t frame_a = structure.frame_of[begin + a];
      const int32_t frame_b = structure.frame_of[begin + b];
      return frame_a != frame_b ? frame_a < frame_b : a < b;
    });
  }
  return order;
}

double BlockVector::Dot(const BlockVector& other) const {
  double sum = 0;
  for (size_t k = 0; k < points.size(); ++k) {
    sum += points[k].dot(other.points[k]);
  }
  for (size_t f = 0; f < frames.size(); ++f) {
    sum += frames[f].dot(other.frames[f]);
  }
  return sum;
}

void BlockVector::Add(double factor, const BlockVector& other) {
  for (size_t k = 0; k < points.size(); ++k) {
    points[k] += factor * other.points[k];
  }
  for (size_t f = 0; f < frames.size(); ++f) {
    frames[f] += factor * other.frames[f];
  }
}

BlockPattern FullPattern(int32_t num_columns) {
  BlockPattern pattern;
  for (int32_t j = 0; j < num_columns; ++j) {
    for (int32_t row = j; row < num_columns; ++row) pattern.row.push_back(row);
    pattern.begin.push_back(pattern.num_blocks());
  }
  return pattern;
}

BlockPattern PairsThatSharePoints(const BlockStructure& structure,
                                  Ranks* ranks) {
  const std::vector<int32_t> numbers = NumberFreeFrames(structure);
  const std::vector<std::vector<int32_t>> points_of =
      PointsOfFrames(structure, numbers);
  const auto num_free =
      static_cast<int32_t>(std::count(structure.frame_is_fixed.begin(),
                                      structure.frame_is_fixed.end(), char{0}));
  BlockPattern pattern;
  std::vector<int32_t> last_column(num_free, -1);  // with this row
  for (int32_t j = 0; j < num_free; ++j) {
    pattern.row.push_back(j);
    last_column[j] = j;
    for (const int32_t k : points_of[j]) {
      for (int64_t i = structure.point_begin[k];
           i < structure.point_begin[k + 1]; ++i) {
        const int32_t other = numbers[structure.frame_of[i]];
        if (other <= j || last_column[other] == j) continue;
        last_column[other] = j;
        pattern.row.push_back(other);
      }
    }
    std::sort(pattern.row.begin() + pattern.begin.back(), pattern.row.end());
    pattern.begin.push_back(pattern.num_blocks());
  }
  if (ranks != nullptr) UniteOverRanks(ranks, &pattern);
  return pattern;
}

SparseFactorSize FindSparseFactorSize(const BlockPattern& pattern) {
  const std::vector<int> begin(pattern.begin.begin(), pattern.begin.end());
  const std::vector<double> ones(pattern.row.size(), 1);
  const SymbolicFactor factor(Eigen::Map<const PatternMatrix>(
      pattern.num_columns(), pattern.num_columns(),
      static_cast<Eigen::Index>(pattern.num_blocks()), begin.data(),
      pattern.row.data(), ones.data()));
  SparseFactorSize size = {0, 0};
  for (const int count : factor.counts()) {
    for (int64_t below : {3 * count, 3 * count + 1, 3 * count + 2}) {
      size.numbers += below + 1;
      size.operations += static_cast<double>(below * below);
    }
  }
  return size;
}

namespace {

// The square root of what is left of a column's squared length, `was` before;
// none if that is next to nothing: then the column is a combination of the ones
// before it.
struct Pivot {
  Pivot(double left, double was) : norm(std::sqrt(left)) {
    const bool is_free = !(norm > 1e-13 * std::sqrt(was));
    if (is_free) norm = std::numeric_limits<double>::infinity();
    scale = is_free ? 0 : 1 / norm;
  }

  double norm, scale;
};

}  // namespace

// Gram and Schmidt's method, which is as orthogonal as Householder's
// reflections where what is left of a column is projected twice [Giraud,
// Langou, Rozloznik 2005]. The sums that a step needs are formed while the step
// before goes through the rows.
UpperTriangle Orthogonalize(int64_t n, double* rows) {
  double* const end = rows + 3 * n;
  double xx = 0, xy = 0, xz = 0, yy = 0, zz = 0;
  for (const double* r = rows; r != end; r += 3) {
    xx += r[0] * r[0];
    xy += r[0] * r[1];
    xz += r[0] * r[2];
    yy += r[1] * r[1];
    zz += r[2] * r[2];
  }
  const Pivot x(xx, xx);
  double R_xy = xy * x.scale, R_xz = xz * x.scale;
  double y_left = 0, z_left = 0;
  for (double* r = rows; r != end; r += 3) {
    r[0] *= x.scale;
    r[1] -= R_xy * r[0];
    r[2] -= R_xz * r[0];
    y_left += r[0] * r[1];
    z_left += r[0] * r[2];
  }
  double yy_left = 0, yz = 0;
  for (double* r = rows; r != end; r += 3) {
    r[1] -= y_left * r[0];
    r[2] -= z_left * r[0];
    yy_left += r[1] * r[1];
    yz += r[1] * r[2];
  }
  R_xy += y_left;
  R_xz += z_left;
  const Pivot y(yy_left, yy);
  double R_yz = yz * y.scale;
  double xz_left = 0, yz_left = 0;
  for (double* r = rows; r != end; r += 3) {
    r[1] *= y.scale;
    r[2] -= R_yz * r[1];
    xz_left += r[0] * r[2];
    yz_left += r[1] * r[2];
  }
  double zz_left = 0;
  for (double* r = rows; r != end; r += 3) {
    r[2] -= xz_left * r[0] + yz_left * r[1];
    zz_left += r[2] * r[2];
  }
  R_xz += xz_left;
  R_yz += yz_left;
  const Pivot z(zz_left, zz);
  for (double* r = rows; r != end; r += 3) r[2] *= z.scale;
  return {x.norm, R_xy, R_xz, y.norm, R_yz, z.norm};
}

}  // namespace krot::internal
