#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/convert/reprojection.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/outliers/conflict.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The observations that a slack programme looks at: those that come near the
// bound, and enough others to tie their points and every frame. Its optimum is
// one of all observations as long as no other exceeds the bound there.
class NearSet {
 public:
  // Empty. Keeps a reference to `problem`.
  explicit NearSet(const KnownRotationProblem& problem);

  // Adds the observations whose errors (one each) are above `level`, and ties.
  // O(observations).
  void AddAbove(const std::vector<double>& errors, double level);

  bool Contains(int64_t i) const { return contains_[i] != 0; }
  // The connected components of its observations, each ascending.
  std::vector<std::vector<int64_t>> Parts() const;

 private:
  void TiePoint(int32_t point);
  void TieFrames();

  const KnownRotationProblem* problem_;
  std::vector<char> contains_;  // per observation
};

// Observations without which all others are within a bound.
struct Removal {
  std::vector<int64_t> observations;  // of the built problem, ascending
  // An estimate at which the true errors of all others are within the bound.
  Estimate estimate;
  // The observations that influenced the slack programmes' solutions: conflicts
  // are looked for among them. Ascending.
  std::vector<int64_t> tight;
};

// Finds few observations to remove by the slack programme
// (conic/interior_point.h). The weights of the first one make it costly to
// exceed the bound by little at the start. Each next one has rows and weights
// from the last solution, as long as this leaves fewer observations above the
// bound [Candes, Wakin, Boyd 2008]. A programme looks at the observations that
// came near the bound so far. Points then take back what fits after all, the
// frames fixed. Never removes more than are above the bound at built.start.
//
// A search may be asked for one bound after the other: each begins with the
// estimate and the weights that the last one ended with.
class RemovalSearch {
 public:
  // Keeps references.
  RemovalSearch(const Model& model, const BuiltProblem& built, Norm norm,
                const Context& context);

  // max_error in true pixels, > 0. Solves at most `max_programmes`; with 0 of
  // them the result is what is above the bound at built.start or, if that is
  // less, at the last search's estimate, but for what points take back.
  Removal Find(double max_error, int max_programmes);

 private:
  double Error(const Estimate& estimate, int64_t i) const {
    return reprojection_.Error(estimate, norm_, i);
  }
  std::vector<double> Errors(const Estimate& estimate) const;
  std::vector<double> WeightsOfErrors() const;
  void SolveProgramme(double smallest_mu);
  void Excess(const std::vector<int64_t>& part, double smallest_mu);
  void Offer(Removal* best) const;
  bool TakeBack(Removal* best);

  const BuiltProblem& built_;
  const Norm norm_;
  const Context context_;
  const Reprojection reprojection_;
  double max_error_ = 0;
  KnownRotationProblem rows_;
  Estimate estimate_;           // of the last programme
  std::vector<double> errors_;  // there
  NearSet near_;
  std::vector<double> weights_;
  std::vector<char> is_tight_;
};

// A search for a single bound.
inline constexpr int kMaxProgrammes = 16;
Removal FindRemoval(const Model& model, const BuiltProblem& built,
                    const ErrorBound& bound, const Context& context,
                    int max_programmes = kMaxProgrammes);

// The indices below `count` that are not `removed` (ascending).
std::vector<int64_t> AllBut(const std::vector<int64_t>& removed, size_t count);

// The lowest largest error of some observations, proved to a thousandth.
struct OptimumWithout {
  Estimate estimate;     // of the whole problem
  double max_error = 0;  // there, true pixels
  // No translations and points bring them below this; true pixels. 0 without a
  // proof; otherwise CheckPixelCertificate accepted it.
  double lower_bound = 0;
  std::optional<PixelCertificate> proof;  // of the built problem
};

// The optimum of all observations but the `removed` (ascending), by
// SolveInRounds from `start`, where their depths must be positive. Observations
// that alone hold a point or a frame bound nothing and are left out.
OptimumWithout SolveWithout(const Model& model, const BuiltProblem& built,
                            const std::vector<int64_t>& removed,
                            const Estimate& start, Norm norm,
                            const Context& context);

}  // namespace krot::internal
