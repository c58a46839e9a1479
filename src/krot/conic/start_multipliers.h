#pragma once

#include <algorithm>
#include <vector>

#include "krot/conic/cone_program.h"
#include "krot/conic/cones.h"
#include "krot/conic/interior_point.h"
#include "krot/conic/newton_system.h"

namespace krot {

// Where the multipliers of the interior point begin, in the cones of `system`.

// z = s^-1: perfectly centred, to be scaled.
template <typename Cone>
void CentreMultipliers(const NewtonSystem<Cone>& system,
                       const std::vector<ViewedPoint>& viewed, double scalar,
                       std::vector<typename Cone::Vector>* z) {
  system.loop().ForEach([&](int64_t i) {
    (*z)[i] = Cone::Divide(system.Slack(viewed[i], scalar), Cone::Identity());
  });
}

// So that the row of g holds: sum lambda w = 1 in the cost programme.
template <typename Cone>
void ScaleMultipliers(const NewtonSystem<Cone>& system,
                      const ConeProgram& program,
                      const std::vector<ViewedPoint>& viewed,
                      std::vector<typename Cone::Vector>* z) {
  const double sum = system.loop().Sum([&](int64_t i) {
    return system.ToMultiplier((*z)[i])[0] *
           program.TopPerScalar(viewed[i].depth);
  });
  system.loop().ForEach([&](int64_t i) { (*z)[i] /= sum; });
}

// Of the cost programme's, which are scaled, all but a small share give way to
// the known ones: far from the path, but near to where it ends. The share goes
// with the margin that the start has, so that both are as far from there.
template <typename Cone>
void JoinKnownMultipliers(const NewtonSystem<Cone>& system, Norm norm,
                          const std::vector<ViewedPoint>& viewed,
                          const std::vector<Multiplier>& known,
                          double start_margin,
                          std::vector<typename Cone::Vector>* z) {
  constexpr double kPerMargin = 100. / 3;
  constexpr double kLargestShare = 0.3;
  const double centred_share =
      std::min(kPerMargin * start_margin, kLargestShare);
  const double sum = system.loop().Sum(
      [&](int64_t i) { return known[i].lambda * viewed[i].depth; });
  if (!(sum > 0)) return;
  system.loop().ForEach([&](int64_t i) {
    const typename Cone::Vector of_known =
        FromMultiplier<Cone::kDim>(norm, known[i].lambda, known[i].y);
    (*z)[i] = centred_share * (*z)[i] + (1 - centred_share) / sum * of_known;
  });
}

}  // namespace krot
