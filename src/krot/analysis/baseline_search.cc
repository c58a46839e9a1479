#include "krot/analysis/baseline_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <tuple>

#include "krot/base/check.h"

namespace krot::internal {
namespace {

// A square of directions on the face of the cube where coordinate `face` is 1.
struct Cell {
  int face = 0;
  double s = 0, t = 0;  // its centre, in the two other coordinates
  double half_width = 1;
  int64_t num_sure = 0;       // matches that all its directions explain
  int64_t order = 0;          // when it was made
  std::vector<int32_t> open;  // matches that some of its directions may explain

  int64_t upper_bound() const {
    return num_sure + static_cast<int64_t>(open.size());
  }
};

// The most promising first; of equals the smallest, which is the nearest to an
// answer.
struct IsLessPromising {
  bool operator()(const Cell& a, const Cell& b) const {
    return std::make_tuple(a.upper_bound(), -a.half_width, -a.order) <
           std::make_tuple(b.upper_bound(), -b.half_width, -b.order);
  }
};

class CellSearch {
 public:
  CellSearch(const std::vector<EpipolarMatch>& matches, double tolerance_px,
             int64_t max_cells)
      : tolerance_px_(tolerance_px), max_cells_(max_cells) {
    for (int face = 0; face < 3; ++face) {
      conditions_[face].reserve(matches.size());
      for (const EpipolarMatch& match : matches) {
        conditions_[face].push_back(ConditionOn(face, match));
      }
    }
    all_.resize(matches.size());
    for (size_t k = 0; k < matches.size(); ++k) {
      all_[k] = static_cast<int32_t>(k);
    }
  }

  BaselineSearch Run() {
    for (int face = 0; face < 3; ++face) {
      Cell cell;
      cell.face = face;
      Look(std::move(cell), 0, all_);
    }
    while (!cells_.empty() && best_.num_cells < max_cells_ &&
           cells_.top().upper_bound() > best_.num_explained) {
      const Cell cell = cells_.top();
      cells_.pop();
      const double half = cell.half_width / 2;
      for (const double ds : {-half, half}) {
        for (const double dt : {-half, half}) {
          Cell part;
          part.face = cell.face;
          part.s = cell.s + ds;
          part.t = cell.t + dt;
          part.half_width = half;
          Look(std::move(part), cell.num_sure, cell.open);
        }
      }
    }
    best_.upper_bound = std::max(best_.num_explained, unresolved_);
    if (!cells_.empty()) {
      best_.upper_bound =
          std::max(best_.upper_bound, cells_.top().upper_bound());
    }
    return best_;
  }

 private:
  // A match in the coordinates (1, s, t) of a face.
  struct Condition {
    Eigen::Vector3d normal;
    Eigen::Matrix<double, 4, 3> gradient;
    double normal_change;    // of normal . b at most, per half width
    double gradient_change;  // of |gradient b| at most, per half width
  };

  static Condition ConditionOn(int face, const EpipolarMatch& match) {
    Condition condition;
    for (int i = 0; i < 3; ++i) {
      condition.normal[i] = match.normal[(face + i) % 3];
      condition.gradient.col(i) = match.gradient.col((face + i) % 3);
    }
    condition.normal_change =
        std::abs(condition.normal[1]) + std::abs(condition.normal[2]);
    condition.gradient_change =
        condition.gradient.col(1).norm() + condition.gradient.col(2).norm();
    return condition;
  }

  // Sorts the matches that the surrounding cell left open, counts what the
  // centre explains, and keeps the cell if it may hold a better direction.
  void Look(Cell cell, int64_t num_sure, const std::vector<int32_t>& open) {
    ++best_.num_cells;
    cell.num_sure = num_sure;
    cell.order = best_.num_cells;
    cell.open.reserve(open.size());
    int64_t num_at_centre = num_sure;
    const Eigen::Vector3d b(1, cell.s, cell.t);
    for (const int32_t k : open) {
      const Condition& condition = conditions_[cell.face][k];
      const double distance = std::abs(condition.normal.dot(b));
      const double allowed = tolerance_px_ * (condition.gradient * b).norm();
      const double change =
          cell.half_width *
          (condition.normal_change + tolerance_px_ * condition.gradient_change);
      if (distance <= allowed) ++num_at_centre;
      if (distance + change <= allowed) {
        ++cell.num_sure;
      } else if (distance - change <= allowed) {
        cell.open.push_back(k);
      }
    }
    if (num_at_centre > best_.num_explained) {
      best_.num_explained = num_at_centre;
      for (int i = 0; i < 3; ++i) best_.baseline[(cell.face + i) % 3] = b[i];
      best_.baseline.normalize();
    }
    if (cell.upper_bound() <= best_.num_explained) return;
    constexpr double kSmallest = 1e-12;
    if (cell.half_width < kSmallest) {
      unresolved_ = std::max(unresolved_, cell.upper_bound());
      return;
    }
    cells_.push(std::move(cell));
  }

  const double tolerance_px_;
  const int64_t max_cells_;
  std::array<std::vector<Condition>, 3> conditions_;
  std::vector<int32_t> all_;
  std::priority_queue<Cell, std::vector<Cell>, IsLessPromising> cells_;
  BaselineSearch best_;
  int64_t unresolved_ = 0;
};

}  // namespace

BaselineSearch SearchBaseline(const std::vector<EpipolarMatch>& matches,
                              double tolerance_px, int64_t max_cells) {
  CheckArgument(tolerance_px > 0, "tolerance_px", tolerance_px, "positive");
  CheckArgument(max_cells > 0, "max_cells", max_cells, "positive");
  return CellSearch(matches, tolerance_px, max_cells).Run();
}

}  // namespace krot::internal
