#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"

namespace krot::internal {

// The lower median of each group's values. Values that are negative or not
// finite, or whose group is -1, do not count; a group without values has NaN.
// Where ranks share the values it is that of all of them, to the bit.
// O(values + 256 groups), eight times.
std::vector<double> GroupMedians(const std::vector<double>& values,
                                 const std::vector<int32_t>& group_of,
                                 int32_t num_groups, const Context& context);

// The same of a single group.
double MedianOf(const std::vector<double>& values, const Context& context);

}  // namespace krot::internal
