#pragma once

#include <cstdint>
#include <string>

#include "tools/benchmark/process.h"

namespace krot::internal {

// A street: frames one after the other, random tracks.
struct Street {
  int64_t observations = 0;  // approximately
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
  bool is_cut = false;  // ended by the limit of sweeps
  double seconds_of_steps = 0;
  int64_t peak_bytes = 0;
  int64_t model_bytes = 0;

  double MicrosecondsPerStep() const {
    return 1e6 * seconds_of_steps / static_cast<double>(steps) / Count();
  }
  double Count() const { return static_cast<double>(num_observations); }
};

// The executable `krot` and its options.
struct KrotRun {
  std::string krot_path;
  int num_threads = 1;    // >= 1
  int max_sweeps = 1000;  // >= 0
  uint64_t random_seed = 0;
};

// Writes a street to the folder `model`, with a noise of one pixel and a start
// that is off the truth by one per cent. Throws CommandError if krot fails.
void SynthesizeStreet(const KrotRun& run, const Street& street,
                      const std::string& model);

// Measures `krot solver` on that model by `method`, from file to file; its
// output goes to `folder`. Throws CommandError if krot fails.
Growth MeasureStreet(const KrotRun& run, const std::string& method,
                     const Street& street, const std::string& model,
                     const ScratchFolder& folder);

}  // namespace krot::internal
