#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/ranks.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Of a problem whose points ranks share, the frames that this rank resects:
// consecutive ones, with about as many observations on every rank. It holds
// those once more, in the order that they have in the whole, so that a frame's
// sub-problem has the same rows as in one process.
//
// Every rank makes one, and they call its functions together.
class FrameShare {
 public:
  FrameShare(const KnownRotationProblem& problem, Ranks* ranks);

  // All frames and views, the observations of those of this rank, and the
  // points that they see.
  const KnownRotationProblem& problem() const { return problem_; }

  // An estimate of that: 24 bytes for every point that another rank's frames
  // see.
  Estimate Receive(const Estimate& estimate) const;

  // Every rank's frames get their translations from it.
  void Publish(const Estimate& share, Estimate* estimate) const;

 private:
  Ranks& ranks_;
  KnownRotationProblem problem_;
  std::vector<int32_t> frame_begin_;  // per rank, and the end
  // Per rank, the points here that its frames see.
  std::vector<std::vector<int32_t>> seen_by_;
};

}  // namespace krot
