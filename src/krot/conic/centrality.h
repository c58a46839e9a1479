#pragma once

#include <algorithm>
#include <utility>

#include "krot/conic/cones.h"

namespace krot {

// Centrality correctors [Gondzio 1996] for a direction of an interior point: a
// solve each, without a factor. One aims at a step that is longer by kLonger,
// where it brings the pairs' products within these shares of the target mu. One
// that does not gain kWorthwhile of kLonger is the last [Colombo, Gondzio
// 2008]. Two took a fifth of the joint iterations away
// (docs/history/journal.md).
struct CentralityCorrectors {
  static constexpr int kLargestNumber = 2;
  static constexpr double kLonger = 0.3;
  static constexpr double kLeastProduct = 0.1;
  static constexpr double kLargestProduct = 10;
  static constexpr double kWorthwhile = 0.1;
  static constexpr double kLongStep = 0.9;  // beyond it, none is needed
};

// Adds to lambda o f what the products of the pairs lack, a longer step ahead,
// of being near mu; takes it back if the step becomes shorter for it. `system`
// offers lambda, target f, direction with scaled ds and dz, Restore, and Solve
// with targets and `centring`, as NewtonSystem does; `longest_step()` is how
// far its direction may be followed.
template <typename Cone, typename System, typename LongestStep>
void ImproveCentrality(double mu, double centring,
                       const LongestStep& longest_step, System* system) {
  using Vector = typename Cone::Vector;
  using C = CentralityCorrectors;
  for (int n = 0; n < C::kLargestNumber; ++n) {
    const double before = longest_step();
    if (before > C::kLongStep) return;
    const double ahead = std::min(1.0, before + C::kLonger);
    typename System::Direction direction = system->direction();
    system->Solve(
        [&](int64_t i) -> Vector {
          const Vector& lambda = system->lambda()[i];
          const Vector product =
              Cone::Product(lambda + ahead * direction.ds[i],
                            lambda + ahead * direction.dz[i]);
          const Vector lacking = Cone::Clamp(product, C::kLeastProduct * mu,
                                             C::kLargestProduct * mu) -
                                 product;
          return system->target()[i] +
                 Cone::Divide(lambda,
                              Cone::Clamp(lacking, -C::kLargestProduct * mu,
                                          C::kLargestProduct * mu));
        },
        centring);
    const double gain = longest_step() - before;
    if (gain < 0) system->Restore(std::move(direction));
    if (gain < C::kWorthwhile * C::kLonger) return;
  }
}

}  // namespace krot
