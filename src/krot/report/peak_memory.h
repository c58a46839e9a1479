#pragma once

#include <cstdint>

namespace krot::internal {

// The largest resident set of this process so far, in bytes.
int64_t PeakMemoryBytes();

}  // namespace krot::internal
