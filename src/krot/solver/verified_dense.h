#pragma once

#include <optional>

#include "krot/solver/uncertain_system.h"

namespace krot {

// Proves that every such system has a solution, and bounds the entries of one:
// |a|_inf <= the result, all roundings accounted for. For small systems,
// however near they are to losing their rank.
//
// Let X be an approximate right inverse and E = I - M X. If |E|_inf = alpha < 1
// then a = -X (I - E)^-1 g exists, solves M a = -g, and
//
//   |a| <= |X| (|g| + alpha / (1 - alpha) |g|_inf)      entry by entry.
//
// None if alpha cannot be shown to be below 1/2: M has not full row rank, or
// too nearly so for double precision; or if there are more than
// kMaxDenseRows rows. Rows are scaled by powers of two first, which changes
// neither solutions nor bits. O(rows^2 columns).
std::optional<double> BoundSolutionByInverse(const UncertainSystem& system);

inline constexpr int64_t kMaxDenseRows = 1500;

}  // namespace krot
