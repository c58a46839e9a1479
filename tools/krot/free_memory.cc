#include "tools/krot/free_memory.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <string>

namespace krot::internal {
namespace {

constexpr int64_t kUnlimited = std::numeric_limits<int64_t>::max();

// "MemAvailable:  12345 kB" of /proc/meminfo, in bytes.
int64_t OfMachine() {
  std::ifstream stream("/proc/meminfo");
  int64_t bytes = 0;
  bool is_said = false;
  std::string key, unit;
  for (int64_t kilobytes; stream >> key >> kilobytes;
       std::getline(stream, unit)) {
    if (key != "MemAvailable:" && key != "SwapFree:") continue;
    is_said |= key == "MemAvailable:";
    bytes += 1024 * kilobytes;
  }
  return is_said ? bytes : kUnlimited;
}

// The whole of it: what else the group holds may be cache.
int64_t OfControlGroup() {
  for (const char* name : {"/sys/fs/cgroup/memory.max",
                           "/sys/fs/cgroup/memory/memory.limit_in_bytes"}) {
    std::ifstream stream(name);
    if (int64_t bytes; stream >> bytes) return bytes;  // not "max"
  }
  return kUnlimited;
}

struct ProcessPages {
  int64_t of_address_space = 0;
  int64_t resident = 0;
};

ProcessPages PagesOfProcess() {
  ProcessPages pages;
  std::ifstream("/proc/self/statm") >> pages.of_address_space >> pages.resident;
  return pages;
}

int64_t OfAddressSpace() {
  rlimit limit = {};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) {
    return kUnlimited;
  }
  return static_cast<int64_t>(limit.rlim_cur) -
         PagesOfProcess().of_address_space * sysconf(_SC_PAGESIZE);
}

}  // namespace

int64_t FreeMemoryBytes() {
  return std::max<int64_t>(
      0, std::min({OfMachine(), OfControlGroup(), OfAddressSpace()}));
}

int64_t BytesStillNeeded(int64_t peak_bytes) {
  return peak_bytes - PagesOfProcess().resident * sysconf(_SC_PAGESIZE);
}

}  // namespace krot::internal
