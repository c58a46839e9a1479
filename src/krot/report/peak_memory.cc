#include "krot/report/peak_memory.h"

#include <sys/resource.h>

namespace krot::internal {

int64_t PeakMemoryBytes() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
#ifdef __APPLE__
  return usage.ru_maxrss;  // bytes
#else
  return static_cast<int64_t>(usage.ru_maxrss) * 1024;  // kB
#endif
}

}  // namespace krot::internal
