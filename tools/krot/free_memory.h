#pragma once

#include <cstdint>

namespace krot::internal {

// Bytes that this process can still take: what is left of the machine's memory
// and swap, of its control group's and of its own address space, the least of
// them. What the system does not say sets no limit.
int64_t FreeMemoryBytes();

// Of the bytes that a process is to hold at its peak, those that it does not
// hold yet.
int64_t BytesStillNeeded(int64_t peak_bytes);

}  // namespace krot::internal
