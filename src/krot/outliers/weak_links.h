#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/outliers/parts.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Parts of a problem that few tracks join, and how well these hold the scale of
// one part against that of the other.

// Two groups of frames that few tracks join.
struct WeakLink {
  std::vector<int32_t> frames;  // of the smaller group, ascending
  int64_t num_tracks = 0;       // that frames of both groups see
  // Of these: the tracks that say something about place and scale, and of these
  // those that agree on the place and the scale that most agree on.
  int64_t num_telling = 0;
  int64_t num_agreeing = 0;
  // The group may be larger or smaller by this factor, about, and the tracks
  // would fit as well; infinite if any scale fits. >= 1.
  double scale_factor = 1;
  // By how much the group's rotations, all alike, would have to turn against
  // the others', degrees, for more tracks to agree, and how many then would;
  // 0: no turn was found. Rotations are known, so that nothing turns.
  double turn_deg = 0;
  int64_t num_agreeing_turned = 0;

  // Beyond this factor, and where the tracks that agree are no more than those
  // that do not, nobody should rely on scale and place.
  bool IsHeld() const {
    return scale_factor <= 1.1 && 2 * num_agreeing > num_telling;
  }
};

// Makes one estimate of those of all parts, whose places and scales have
// nothing to do with each other: the two groups that share most tracks are
// joined first, and so on. For every scale on a fine logarithmic grid the place
// is found at which the tracks of both fit best, whatever some of them say
// (reprojection errors, squared, each track's cut off); of all scales the best
// is taken. A scale that is no worse by more than three standard deviations of
// the noise may be the right one, too: WeakLink::scale_factor.
//
// Translations of `*estimate` change; points that it has are those of their
// part (point_part; -1: it has none) and change with it.
std::vector<WeakLink> JoinParts(const KnownRotationProblem& problem,
                                const std::vector<int32_t>& parts,
                                const std::vector<int32_t>& point_part,
                                double cap, const Context& context,
                                Estimate* estimate);

// The same links of an estimate that is one already, of which only the
// translations count: by how much the scales could be other than they are.
// Every component's; none where no part hangs on few tracks. Points are placed
// anew, no error counted for more than `cap`, pixels.
std::vector<WeakLink> FindWeakLinks(const KnownRotationProblem& problem,
                                    const Estimate& estimate, double cap,
                                    const Context& context);

}  // namespace krot::internal
