#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/checkpoint.h"
#include "krot/conic/interior_point.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// What a solve leaves to the next, similar one: multipliers of some of a
// problem's observations, named by increasing numbers. Only those that are
// known take memory.
class KnownMultipliers {
 public:
  // `multipliers` of the observations that `names` ascend through take the
  // place of what was known of them; `optimum`, pixels, is where their solve
  // would have come to. O(known + names).
  void Keep(const std::vector<int64_t>& names,
            const std::vector<Multiplier>& multipliers, double optimum);

  // Of the solve that was kept last; 0: none was.
  double optimum() const { return optimum_.empty() ? 0 : optimum_[0]; }

  // Of the observations that `names` ascend through, zero where it is not
  // known; empty if none is. O(known + names).
  std::vector<Multiplier> Of(const std::vector<int64_t>& names) const;

  // For a checkpoint; where ranks share a problem, the first one's.
  void NameValues(StepValues* values) {
    values->OnFirst(&known_);
    values->OnFirst(&optimum_);
  }

 private:
  std::vector<CertifiedObservation> known_;
  std::vector<double> optimum_;  // one, if any
};

}  // namespace krot::internal
