#pragma once

#include <algorithm>
#include <vector>

#include "krot/base/context.h"
#include "krot/conic/excess_program.h"
#include "krot/conic/excess_system.h"

namespace krot {

// One run of the interior point on the excess programme, as in conic_solver.h
// on the others. `depths` are those at the start, and `has_depths` whether it
// has any.
template <typename Cone>
class ExcessSolver {
 public:
  ExcessSolver(const KnownRotationProblem& problem, double bound,
               const ExcessOptions& options, const Context& context,
               const Estimate& start, const std::vector<double>& depths,
               bool has_depths);

  ExcessSolution Run(Estimate* estimate);

 private:
  using Vector = typename Cone::Vector;
  using Iterate = typename ExcessSystem<Cone>::Iterate;
  using Target = typename ExcessSystem<Cone>::Target;

  struct Steps {
    double primal = 1;
    double dual = 1;
    double Least() const { return std::min(primal, dual); }
  };

  static std::vector<double> CostsOf(const ExcessOptions& options,
                                     const std::vector<double>& depths) {
    std::vector<double> costs(depths.size());
    for (size_t i = 0; i < costs.size(); ++i) {
      const double weight = options.weights.empty() ? 1 : options.weights[i];
      costs[i] = weight / depths[i];
    }
    return costs;
  }

  double CentredSigma(const ViewedPoint& viewed, double cost, double mu) const;
  void Start(const Estimate& start);
  void ViewAll(Iterate* iterate) const;
  Steps MaxSteps(double damping) const;
  double AffineSigma() const;
  void FindDirection(bool only_centre);
  bool IsInside(const Iterate& trial) const;
  double TakeStep();

  const KnownRotationProblem& problem_;
  const ExcessOptions options_;
  const Context& context_;
  const double bound_;
  const std::vector<double>& depths_;
  const std::vector<double> costs_;
  const double min_depth_;
  ExcessSystem<Cone> system_;
  double size_ = 1;  // e'x
  Iterate now_, trial_;
};

}  // namespace krot
