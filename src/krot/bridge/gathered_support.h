#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/ranks.h"
#include "krot/bridge/bridge.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// Where ranks share a model's points: those that some observations see, with
// all that proofs need of them, on the first rank. Numbers "in the whole" count
// through the ranks' observations, one rank's after another's.
struct GatheredSupport {
  Model model;         // without 2D points and tracks
  BuiltProblem built;  // all frames and views
  Estimate estimate;
  std::vector<int64_t> in_whole;      // per observation, ascending
  std::vector<int64_t> observations;  // those that were asked for, likewise

  int64_t Find(int64_t number) const;  // of one in the whole
  // A certificate's observations by what they are called here, and back.
  Certificate FromWhole(Certificate certificate) const;
  Certificate ToWhole(Certificate certificate) const;
};

// Of `observations`, this rank's own, ascending. All ranks call it; on others
// than the first the result has no points.
GatheredSupport GatherSupport(const Model& model, const BuiltProblem& built,
                              const Estimate& estimate,
                              const std::vector<int64_t>& observations,
                              Ranks* ranks);

// Which of its `num_observations` the first rank's certificate names in the
// whole, on every rank; ascending.
std::vector<int64_t> OwnSupport(const Certificate& certificate,
                                int64_t num_observations, Ranks* ranks);

}  // namespace krot::internal
