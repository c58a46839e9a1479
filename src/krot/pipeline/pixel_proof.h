#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/pipeline/solve_model.h"
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

// A lower bound in true pixels for all estimates, from the observations that
// set the maximum of the linear rows: `support`, ascending indices. `built` has
// the rows that were taken at `x_hat`; the nearer that is to the optimum of the
// true errors, the higher is the bound.
//
// The support's own problem, which is small, is solved once more for these
// rows; a row whose support line (pixel_certificate.h) is crossed by its
// observation's true set is widened until it is not, and the problem solved
// again, until the bound is `sufficient`, pixels. None if nothing is proved.
std::optional<PixelCertificate> ProveInPixels(const Model& model,
                                              const BuiltProblem& built,
                                              const Estimate& x_hat, Norm norm,
                                              std::vector<int64_t> support,
                                              double sufficient,
                                              const Context& context);

// The same from a certificate of the rows that were solved. Where rows do not
// depend on where they are taken it is that certificate's own. Where ranks
// share the points the first one has the result, in the numbers of the whole
// (certificate_file.h), the others its lower bound. Of the options it takes
// norm and checkpoint: it is a step.
std::optional<PixelCertificate> ProveRows(
    const Model& model, const BuiltProblem& built, const Estimate& x_hat,
    const SolveModelOptions& options, const RowsCertificate& rows,
    double sufficient, const Context& context);

// The observations of a certificate, by what they are called in the whole;
// those that are not there are left out.
std::vector<int64_t> SupportOf(const RowsCertificate& rows);

// Checks a certificate once more, apart from the solver that made it, and says
// in the summary what it proves about the estimate. Where ranks share the
// points all call it, and the first one's summary has it.
void Certify(const Model& model, const BuiltProblem& built,
             const Estimate& estimate, const SolveModelOptions& options,
             const Context& context,
             std::optional<PixelCertificate> certificate,
             SolveSummary* summary);

// That no estimate is below a start's bound, in true pixels.
void CertifyInfeasible(const Model& model, const BuiltProblem& built,
                       const SolveModelOptions& options, const Context& context,
                       const std::optional<Certificate>& certificate,
                       SolveSummary* summary);

}  // namespace krot::internal
