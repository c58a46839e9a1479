#pragma once

#include <cstdint>

#include "tools/benchmark/benchmark_model.h"

namespace krot::internal {

// The sizes of [Zhang18, Tab. 2].
struct ModelSize {
  const char* name;
  int num_frames;
  int num_points;
  int64_t num_observations;
};

inline constexpr ModelSize kPaperSizes[] = {
    {"House (S)", 12, 2174, 12037},   {"Lund (S)", 17, 2873, 13629},
    {"Yard", 133, 23674, 321554},     {"Tower", 172, 14828, 169618},
    {"UWO (L)", 692, 97326, 1324698}, {"Lund (L)", 1208, 103940, 2002637},
};
inline constexpr int kNumPaperSizes = 6;

// A synthetic model of about that size (its tracks are random), named
// "synthetic House (S)". Up to 20 frames it is an orbit, with more a street: in
// a large scene few images see the same points. It has pinhole cameras, noise
// of 1 pixel, and a start off the truth by 1 % of the viewing distance.
BenchmarkModel SyntheticModel(const ModelSize& size, uint64_t seed);

}  // namespace krot::internal
