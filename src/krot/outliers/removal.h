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
// bound, and enough others to tie their points and every frame. An optimum of
// theirs is one of all as long as no other exceeds the bound there.
class NearSet {
 public:
  // Empty. Keeps a reference to `problem`.
  explicit NearSet(const KnownRotationProblem& problem);

  // Adds the observations whose error, one each, is above `level`, and ties.
  // O(observations).
  void AddAbove(const std::vector<double>& errors, double level);

  bool Contains(int64_t i) const { return contains_[i] != 0; }
  // By connected component, each ascending.
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
  // At which the true errors of all others are within the bound.
  Estimate estimate;
  // The observations that had a say in it: conflicts are to be looked for among
  // them. Ascending.
  std::vector<int64_t> tight;
};

// Few observations to remove, by the slack programme (conic/interior_point.h):
// solved with weights that make those dear that exceed the bound by little at
// the start, and again with those of the solution, as long as that makes them
// fewer [Candes, Wakin, Boyd 2008]; rows are taken anew each time. It looks at
// the observations that came near the bound so far; points then take back what
// they can where the frames stand. Never more than are above the bound at
// built.start.
//
// One bound after the other: each begins with the estimate and the weights that
// the last one ended with.
class RemovalSearch {
 public:
  // Keeps references.
  RemovalSearch(const Model& model, const BuiltProblem& built, Norm norm,
                const Context& context);

  // max_error in true pixels, > 0; solves at most so many programmes. Of 0 it
  // is what is above the bound at built.start, but for what points take back.
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

// With a bound alone.
inline constexpr int kMaxProgrammes = 16;
Removal FindRemoval(const Model& model, const BuiltProblem& built,
                    const ErrorBound& bound, const Context& context,
                    int max_programmes = kMaxProgrammes);

// The lowest largest error of some observations, proved.
struct OptimumWithout {
  Estimate estimate;     // of the whole
  double max_error = 0;  // there, true pixels
  // That no translations and points bring them below; true pixels, 0 without a
  // proof, which CheckPixelCertificate accepted otherwise.
  double lower_bound = 0;
  std::optional<PixelCertificate> proof;  // of the built problem
};

// Of all observations but the `removed` (ascending), by SolveInRounds from
// `start`, where the depths of the others must be positive. Those that alone
// hold a point or a frame bound nothing and have no part.
OptimumWithout SolveWithout(const Model& model, const BuiltProblem& built,
                            const std::vector<int64_t>& removed,
                            const Estimate& start, Norm norm,
                            double relative_gap, const Context& context);

}  // namespace krot::internal
