#pragma once

#include <optional>
#include <vector>

#include "krot/finish/bounded_least_squares.h"
#include "krot/finish/bounded_system.h"

namespace krot {

// One run of bounded least squares along the central path: the minima of
//
//   1/2 sum rho - mu sum log(h_j(e) / h_j(0))
//
// as mu falls. An iteration
//
//   Factorize       the Newton system at now_; it ends here if mu is small
//                   enough and Newton's step would gain next to nothing
//   FindDirection   a predictor, mu = 0, and a corrector [Mehrotra 1992]
//   TakeStep        the longest, then shorter ones until the barrier cost does
//                   not rise: trial_ becomes now_; where none is found along
//                   the corrector's direction, along Newton's
//
// Multipliers take their full steps, each by itself, but none falls far below
// the path: whatever they are, as long as they are positive, a direction leads
// downwards, and the barrier cost alone decides on progress.
template <typename Cap>
class BoundedPath {
 public:
  BoundedPath(const KnownRotationProblem& problem,
              const BoundedOptions& options, const Context& context,
              const Estimate& start);

  BoundedSummary Run();

  const Estimate& estimate() const { return now_.x; }

  static int64_t MemoryBytes(const KnownRotationProblem& problem);

 private:
  using Vector = typename Cap::Vector;

  struct State {
    Estimate x;
    std::vector<ViewedError> viewed;
    double cost = 0;     // 1/2 sum rho
    double barrier = 0;  // -sum log(h_j(e) / h_j(0))
  };

  int32_t NumViews() const {
    return options_.num_views.value_or(
        static_cast<int32_t>(problem_.views.size()));
  }
  bool TakeRows(const Estimate& x) {
    return !options_.take_rows || context_.All(options_.take_rows(x));
  }
  // Whether every error is below the cap.
  bool View(State* state);
  double BarrierCost(const State& state, double mu) const {
    return state.cost + mu * state.barrier;
  }
  double Count() const {  // of pairs
    return static_cast<double>(system_.loop().whole_count() * Cap::kNum);
  }
  double MuOf(double relative_gap) const {
    return relative_gap * now_.cost / Count();
  }
  double RelativeGap() const {
    return now_.cost > 0 ? Count() * mu_ / now_.cost : 0;
  }

  // mu / h, with slacks h of no less than this share of the cap's.
  void CentreMultipliers(double mu, double least_slack);
  double FindDirection();
  double AffineSigma() const;
  // Sets step_, 0 if none is found, and returns what it takes off the cost.
  double TakeStep(double mu);
  void MoveMultipliers(double mu);
  std::optional<BoundedTermination> Iterate(BoundedSummary* summary);
  int64_t NumActive() const;

  const KnownRotationProblem& problem_;  // rows: those of the last state viewed
  const BoundedOptions options_;
  const Context context_;
  BoundedSystem<Cap> system_;
  State now_;
  State trial_;
  std::vector<Vector> multipliers_;
  double mu_ = 0;            // mean of the pairs at now_
  double step_ = 1;          // that led to now_
  int num_idle_ = 0;         // steps in a row
  bool is_centred_ = false;  // all pairs are, since no step was found
};

}  // namespace krot
