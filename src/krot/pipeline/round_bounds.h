#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "krot/bridge/pixel_certificate.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// A certificate of rows, and what its observations are called among those of
// the whole problem, -1: none; empty: the same.
struct RowsCertificate {
  Certificate certificate;
  std::vector<int64_t> observation_of;
};

// What rounds have proved so far, in true pixels and of the rows that were
// solved last, and what that says of a true cost in pixels. Internal to
// SolveInRounds.
class RoundBounds {
 public:
  // The gap asked for.
  explicit RoundBounds(double relative_gap) : relative_gap_(relative_gap) {}

  const std::optional<RowsCertificate>& rows() const { return rows_; }
  void SetRows(std::optional<RowsCertificate> rows) { rows_ = std::move(rows); }
  // The rows' certificate, to be proved in pixels: each is tried once.
  std::optional<RowsCertificate> UseRows() {
    return std::exchange(rows_, std::nullopt);
  }

  const std::optional<PixelCertificate>& proof() const { return proof_; }
  void SetProof(std::optional<PixelCertificate> proof) {
    proof_ = std::move(proof);
  }
  void Improve(std::optional<PixelCertificate> proof) {
    if (!proof) return;
    if (!proof_ || proof->lower_bound > proof_->lower_bound) SetProof(proof);
  }

  bool IsGapReached(double cost) const {
    return proof_ && std::isfinite(cost) &&
           cost - proof_->lower_bound <= relative_gap_ * cost;
  }
  // The proved bound that is enough: the rest is for roundings behind it.
  double Sufficient(double cost) const {
    constexpr double kShare = 0.95;
    return (1 - kShare * relative_gap_) * cost;
  }
  // Whether the cost is so near to what is proved of the rows that its own
  // proof may reach the gap.
  bool IsWorthProving(double cost) const {
    constexpr double kGaps = 3;
    return rows_ && cost - rows_->certificate.lower_bound <=
                        kGaps * relative_gap_ * cost;
  }
  // Whether it is as near to a bound as is asked for, or so near to that of the
  // rows that a proof in pixels, which is below, should be as near.
  bool IsNear(double cost) const {
    constexpr double kShareForRows = 0.7;
    return (proof_ && proof_->lower_bound >= Sufficient(cost)) ||
           (rows_ && rows_->certificate.lower_bound >=
                         (1 - kShareForRows * relative_gap_) * cost);
  }

 private:
  const double relative_gap_;
  std::optional<RowsCertificate> rows_;
  std::optional<PixelCertificate> proof_;
};

}  // namespace krot::internal
