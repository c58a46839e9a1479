#pragma once

#include "krot/minimax/lane_memory.h"

namespace krot::internal {

// What has become of a lane's problem.
inline constexpr double kLaneIdle = 0;   // there is none
inline constexpr double kLaneFresh = 1;  // has not been looked at yet
inline constexpr double kLaneRuns = 2;
// The ends, as those of NewtonDescent:
inline constexpr double kLaneStationary = 3;
inline constexpr double kLaneZeroCost = 4;
inline constexpr double kLaneLowEnough = 5;
inline constexpr double kLaneBehind = 6;
// Not one for lanes: it is far away, or takes too many steps.
inline constexpr double kLaneGivesUp = 7;

// As DescentGoal.
struct LaneGoal {
  double tolerance;
  double level;
  double sufficient;
  int max_iterations;
};

// The descents of all lanes between two steps. A lane begins with `status`
// kLaneFresh, `count`, `x`, the active residuals of a warm start, if there is
// any, and what Begin sets.
struct alignas(64) LaneDescents {
  LaneDoubles status;
  LaneDoubles count;  // residuals, >= 1
  LaneDoubles x[3];
  LaneDoubles cost_initial;
  LaneDoubles cost;
  LaneDoubles iterations;  // steps tried

  // The active set: indices of residuals or of lane_hull.h, and weights.
  LaneDoubles index[kCorners];
  LaneDoubles weight[kCorners];
  // What they give to H of the next step: over residuals alone, with sum 1.
  LaneDoubles multiplier[kCorners];

  LaneDoubles is_cold;  // whether a first step is for the multipliers alone
  LaneDoubles raises;   // whether multipliers only rise
  LaneDoubles kappa;
  LaneDoubles lessons;
  LaneDoubles cost_failed;
  LaneDoubles calls;
  LaneDoubles depth_start;
  LaneDoubles x_metric[3];
  LaneDoubles metric[6];

  // Prepares a lane whose problem, warm start included, is set.
  void Begin(int lane);
};

// Whether the vectors that the kernel was compiled for are long enough, four
// numbers or more: with two, lanes take longer than one problem after the
// other.
bool LanesPay();

// One step of NewtonDescent, for p = 2, in every lane that has a problem, or
// part of one where active sets change often: minimises the model of all
// residuals and tries the step. Failed trials teach the model multipliers, but
// no tangents. Ends as NewtonDescent does, or gives up. What a lane does
// depends on its own problem alone. `pieces`: memory for as many as rows, the
// same in all steps. About 30 ns per row and step, all lanes together, and 400
// ns.
void StepLanes(const LaneRow* rows, int num_rows, const LaneGoal& goal,
               LaneDescents* descents, LanePiece* pieces);

}  // namespace krot::internal
