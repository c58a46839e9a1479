#pragma once

#include <limits>
#include <optional>
#include <utility>

#include "krot/bridge/position_rows.h"

namespace krot::internal {

// Within this of the radius, relative, positions are kept in rounds: less than
// is allowed in the end, so that the finish begins inside.
inline constexpr double kKeptInRounds = kKeptPosition / 2;

// The level at which positions are kept, pixels. Rows of a level L have
// residuals below the cost where every camera is within cost / L of its radius,
// so their optimum G(L) is that of the problem at L = G(L). G rises with L,
// slower than L: the fixed point is found by secants in logarithms, a solve
// each.
class PositionLevel {
 public:
  // Relative: by how much the optimum may be missed.
  explicit PositionLevel(double tolerance) : tolerance_(tolerance) {}

  // After a solve at `level` whose rows' optimum is `optimum`, pixels, the
  // estimate having a levelled cost of `cost` and the largest ratio of a
  // camera's distance from its position to the radius: the level of the next
  // one, a little above the fixed point, so that positions are kept; none if
  // the level will do.
  std::optional<double> Next(double level, double optimum, double cost,
                             double ratio);

 private:
  double tolerance_;
  double slope_ = 0;
  // Logarithms: of the last level and its optimum, of bounds of the fixed
  // point.
  std::optional<std::pair<double, double>> last_;
  double lowest_ = -std::numeric_limits<double>::infinity();
  double highest_ = std::numeric_limits<double>::infinity();
};

}  // namespace krot::internal
