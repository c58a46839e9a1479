#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "krot/analysis/rotation_input.h"
#include "krot/base/timer.h"
#include "krot/model/contradictions.h"
#include "krot/model/pose_checks.h"

namespace krot::internal {

// What every run that solves for a model records beside its result.
struct RunRecord {
  std::string version;            // KROT's
  Contradictions contradictions;  // of the input
  PoseChecks poses;               // likewise
  // Where the input's rotations were not its own.
  std::optional<RotationInput> rotations;
  double seconds_read = 0;  // wall clock
  double seconds_write = 0;
  double seconds_total = 0;
  int64_t peak_memory_bytes = 0;
  int threads = 0;
  uint64_t seed = 0;
};

// Version, threads, the time since the timer was made, the process's memory.
void RecordEnd(const Timer& timer, int num_threads, RunRecord* run);

// "Read 0.10 s, MIDDLE, wrote 0.20 s; 1.50 s in all on 2 threads, ...\n".
std::string RunSentence(const RunRecord& run, const std::string& middle);

}  // namespace krot::internal
