#pragma once

#include <functional>
#include <vector>

namespace krot::internal {

// The median; the mean of the two in the middle for an even count. Requires at
// least one value.
double MedianOf(std::vector<double> values);

// Median seconds of this thread's processor time of one call of each of `runs`,
// out of `repeats` rounds in which every one is called in turn, so that what
// disturbs the machine for a while disturbs all of them alike; processor time,
// so that others on the machine count for little. What takes less than
// `min_seconds` is called in a loop that takes at least as long. One round goes
// ahead unmeasured where there is such a loop.
std::vector<double> TimeInterleaved(
    const std::vector<std::function<void()>>& runs, int repeats,
    double min_seconds);

}  // namespace krot::internal
