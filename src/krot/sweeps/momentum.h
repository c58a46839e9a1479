#pragma once

#include "krot/base/context.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Nesterov's momentum with restarts [Nesterov 1983; O'Donoghue, Candes 2015],
// around a method that improves an estimate: every sweep starts a little
// further along the last improvement. A sweep that ends above the best cost
// is thrown away, so the best cost never rises.
//
// Alternation converges slowly along the directions in which points and
// frames must move together; momentum is what follows them.
class Momentum {
 public:
  // Starts at `start`, of cost `cost`; keeps a reference to `problem`.
  Momentum(const KnownRotationProblem& problem, const Context& context,
           const Estimate& start, double cost);

  // Where the next sweep starts: the best estimate, or beyond it as far as
  // all depths stay positive.
  Estimate NextStart();

  // Takes what the sweep from NextStart() has reached, if it is no worse: one
  // that leaves the cost where it is may still have moved other blocks.
  void Accept(const Estimate& reached, double cost);

  const Estimate& best() const { return best_; }
  double best_cost() const { return best_cost_; }

 private:
  const KnownRotationProblem& problem_;
  const Context context_;
  Estimate best_;
  Estimate previous_;  // the best one before it
  double best_cost_;
  int improvements_ = 0;  // since the last restart
};

}  // namespace krot
