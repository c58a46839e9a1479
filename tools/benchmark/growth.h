#pragma once

#include <cstdint>
#include <string>

#include "tools/benchmark/process.h"

namespace krot::internal {

// A street: frames one after the other, random tracks.
struct Street {
  int64_t observations = 0;  // about so many
  int64_t frames = 0;
  int64_t track_length = 10;  // mean
};

// Seconds are wall clock.
struct Growth {
  std::string method;
  Street street;
  int64_t num_observations = 0;
  double read = 0;
  double solve = 0;
  double write = 0;
  double total = 0;
  int64_t steps = 0;    // sweeps, or iterations of the joint solver
  bool is_cut = false;  // by the limit of sweeps
  double seconds_of_steps = 0;
  int64_t peak_bytes = 0;
  int64_t model_bytes = 0;

  double MicrosecondsPerStep() const {
    return 1e6 * seconds_of_steps / static_cast<double>(steps) / Count();
  }
  double Count() const { return static_cast<double>(num_observations); }
};

// How `krot` is run.
struct KrotRun {
  std::string krot_path;
  int num_threads = 1;    // >= 1
  int max_sweeps = 1000;  // >= 0
  uint64_t random_seed = 0;
};

// Writes a street with a noise of one pixel and a start off the truth by a
// percent to the folder `model`. Throws CommandError where krot fails.
void SynthesizeStreet(const KrotRun& run, const Street& street,
                      const std::string& model);

// `krot solver` on that, from file to file, by `method`; what it writes goes to
// `folder`. Likewise.
Growth MeasureStreet(const KrotRun& run, const std::string& method,
                     const Street& street, const std::string& model,
                     const ScratchFolder& folder);

}  // namespace krot::internal
