#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/outliers/conflict.h"
#include "krot/outliers/removal.h"

namespace krot::internal {

// How low the largest error can be without some of the observations, and from
// where on that is no noise.

// What Gaussian noise explains.
struct NoiseLimit {
  double sigma = 0;  // per axis, pixels
  // In a model of such noise alone no error is above this with a probability of
  // 95 %; true pixels of the norm; > 0.
  double max_error = 0;
};

// The sigma that SnoopNoise ends with, at the cameras of the model or of
// FindRobustStart, moved on to a robust least squares, whichever has less: the
// latter do not mind a start that is off. One of N errors is above
// sigma sqrt(2 ln(N / 0.05)) with a probability of 5 % at most (Bonferroni).
// Nothing below a thousandth of a pixel is told from rounding. Takes less than
// a solve.
NoiseLimit FindNoiseLimit(const Model& model, const BuiltProblem& built,
                          Norm norm, const Context& context);

// The same at built.start alone. O(observations).
NoiseLimit NoiseLimitAtStart(const Model& model, const BuiltProblem& built,
                             Norm norm, const Context& context);

struct ErrorProfileOptions {
  Norm norm;
  // The last level's largest error, true pixels; > 0. None: half of the first
  // or, if that is lower and the first is above it, what noise explains.
  std::optional<double> max_error;
  double relative_gap = 1e-3;  // of every level; > 0
  int num_levels = 6;          // about, below the first; >= 1
  // Levels with more observations removed are asked for no conflicts of their
  // own.
  size_t max_charged = 50;
};

struct ProfileLevel {
  // What is left out, and where all others are within max_error.
  Removal removal;
  double max_error = 0;  // true pixels
  // That no translations and points bring all others below; true pixels, 0
  // without a proof, which CheckPixelCertificate accepted otherwise.
  double lower_bound = 0;
  std::optional<PixelCertificate> proof;  // of the built problem
  // So many must go at least for all others to be within max_error: the first
  // so many conflicts of the profile.
  int64_t num_proved = 0;
};

struct ErrorProfile {
  // More removed and a lower maximum from each to the next; nothing is removed
  // in the first.
  std::vector<ProfileLevel> levels;
  std::vector<Conflict> conflicts;  // disjoint
  NoiseLimit noise;
  // Where what is no noise ends: the first level that noise explains, if it is
  // proved that the one of all observations is above that. None: noise explains
  // them all, as far as is proved, or none of the levels.
  std::optional<size_t> elbow;
};

// From one optimum to the next: observations are removed for a bound below it
// (RemovalSearch), in equal ratios down to the last, stopping at what noise
// explains, and what is left is solved anew (SolveInRounds). Tracks that keep
// one observation hold nothing any more and have no part in the errors.
// Cancelled, it ends with the levels so far. Every level takes about as long as
// two solves.
ErrorProfile FindErrorProfile(const Model& model, const BuiltProblem& built,
                              const ErrorProfileOptions& options,
                              const Context& context);

}  // namespace krot::internal
