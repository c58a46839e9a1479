#include "tools/krot/machine.h"

#include <stdlib.h>

#include <fstream>

#include "krot/base/parallel_for.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

// "model name : AMD EPYC" of /proc/cpuinfo.
std::string CpuName() {
  std::ifstream stream("/proc/cpuinfo");
  for (std::string line; std::getline(stream, line);) {
    const size_t colon = line.find(": ");
    if (line.rfind("model name", 0) == 0 && colon != std::string::npos) {
      return line.substr(colon + 2);
    }
  }
  return "unknown";
}

}  // namespace

Machine ThisMachine() {
  Machine machine;
  machine.cpu = CpuName();
  machine.cores = ResolveNumThreads(-1);
#ifdef __clang__
  machine.compiler = "Clang " __clang_version__;
#else
  machine.compiler = "GCC " __VERSION__;
#endif
  machine.flags = KROT_BUILD_FLAGS;
  getloadavg(&machine.load, 1);
  return machine;
}

std::string MachineLine(const Machine& machine) {
  return machine.cpu + ", " + Counted(machine.cores, "core") + ", load " +
         FormatNumber(machine.load, 1) + "; " + machine.compiler + ", " +
         machine.flags;
}

}  // namespace krot::internal
