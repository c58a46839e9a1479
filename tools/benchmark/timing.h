#pragma once

#include <functional>
#include <vector>

namespace krot::internal {

// The median; the mean of the two in the middle for an even count. Requires at
// least one value.
double MedianOf(std::vector<double> values);

// For each of `runs`, the median over `repeats` rounds of the seconds of this
// thread's processor time that one call takes. In a round all are called in
// turn, so that a temporary disturbance of the machine affects all of them.
// Processor time is measured so that other processes matter little. A run that
// takes less than `min_seconds` is called in a loop that takes about that long;
// to find the number of calls, it is first called once without being measured.
std::vector<double> TimeInterleaved(
    const std::vector<std::function<void()>>& runs, int repeats,
    double min_seconds);

}  // namespace krot::internal
