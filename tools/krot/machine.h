#pragma once

#include <string>

namespace krot::internal {

// The machine of a run, without which times mean nothing.
struct Machine {
  std::string cpu;  // model name; "unknown" where the system does not say
  int cores = 0;    // hardware threads
  std::string compiler;
  std::string flags;  // of the build
  double load = 0;    // runnable processes, mean of the last minute
};

Machine ThisMachine();

// For example "AMD EPYC, 2 cores, load 1.0; GCC 12.2.0, Release".
std::string MachineLine(const Machine& machine);

}  // namespace krot::internal
