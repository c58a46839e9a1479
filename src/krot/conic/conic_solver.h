#pragma once

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "krot/conic/interior_point.h"
#include "krot/conic/newton_system.h"

namespace krot {

// One run of the interior point, in a wide neighbourhood of the central path:
//
//   Factorize       the Newton system at now_
//   FindDirection   one Solve each for
//                     a predictor, f = 0              } not after a short step
//                     a corrector [Mehrotra 1992]       only centres then
//                     up to two centrality correctors [Gondzio 1996]
//   TakeStep        the longest, then shorter ones until one IsInside the
//                   neighbourhood: trial_ becomes now_
//   what was reached: multipliers, gap, the best estimate; enough?
//
// Slacks are recomputed at every trial: top = g w is bilinear. Where it is
// linear, in the feasibility programme, slacks and multipliers have step
// lengths of their own.
template <typename Cone>
class ConicSolver {
 public:
  ConicSolver(const KnownRotationProblem& problem,
              const InteriorPointOptions& options, const Context& context,
              const ConeProgram& program, const Estimate& start, double scalar);

  InteriorPointSummary Run();

  const Estimate& best() const { return best_; }
  std::vector<Multiplier> TakeMultipliers() { return std::move(multipliers_); }

  static int64_t MemoryBytes(const KnownRotationProblem& problem);

 private:
  using Vector = typename Cone::Vector;

  struct State {
    Estimate x;
    double scalar = 0;  // g: gamma or tau
    std::vector<ViewedPoint> viewed;
    std::vector<Vector> z;
    double gap = 0;   // sum s'z
    double cost = 0;  // pixels
  };

  // Along ds, and so x and g, and along dz.
  struct StepLengths {
    double primal = 0;
    double dual = 0;
    double Least() const { return std::min(primal, dual); }
  };

  void ViewAll(State* state) const;
  void FindStartMultipliers();
  bool Factorize() {
    return system_.Factorize(now_.viewed, now_.scalar, now_.z);
  }
  bool FactorizeBalanced();
  double RelativeGap() const;
  void FindDirection(bool only_centre);
  double AffineSigma() const;
  StepLengths MaxSteps(double damping) const;
  bool IsInside(const State& trial) const;
  double TakeStep();
  void ExportMultipliers();
  std::optional<InteriorPointTermination> Iterate(
      InteriorPointSummary* summary);

  const KnownRotationProblem& problem_;
  const InteriorPointOptions options_;
  const Context context_;
  const ConeProgram program_;
  NewtonSystem<Cone> system_;
  State now_;
  State trial_;
  bool is_factorized_ = false;  // system_, at now_
  // Linear programme: stationarity holds up to rounding. Until then steps only
  // centre: where nothing is active it would be missed by as much as there is.
  bool is_balanced_ = false;
  double start_ = 0;  // g there
  double step_ = 1;   // that led to now_
  Estimate best_;
  double best_cost_ = 0;  // or the lowest h'x
  std::vector<Multiplier> multipliers_;
};

}  // namespace krot
