#include "tools/krot/machine.h"

#include "krot/base/parallel_for.h"
#include "krot/base/system.h"
#include "krot/report/text_table.h"

namespace krot::internal {
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
  machine.load = LoadAverage();
  return machine;
}

std::string MachineLine(const Machine& machine) {
  return machine.cpu + ", " + Counted(machine.cores, "core") + ", load " +
         FormatNumber(machine.load, 1) + "; " + machine.compiler + ", " +
         machine.flags;
}

}  // namespace krot::internal
