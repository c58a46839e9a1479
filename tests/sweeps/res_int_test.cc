#include "krot/sweeps/res_int.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "krot/problem/cost.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

// Sweeps and Cost() evaluate the same residuals, of rows and of poses.
constexpr double kCostRounding = 1e-12;  // pixels

RandomScene MakeScene(unsigned seed) {
  RandomSceneOptions options;
  options.num_frames = 6;
  options.num_points = 600;  // several chunks
  options.seed = seed;
  return MakeRandomScene(options);
}

// The same scene, observed without noise, from a start beside it.
RandomScene MakeExactScene() {
  RandomScene scene = MakeScene(3);
  for (Observation& observation : scene.problem.observations) {
    const View& view = scene.problem.views[observation.view];
    const Eigen::Vector3d x_cam = view.cam_from_world_rotation *
                                      scene.estimate.points[observation.point] +
                                  scene.estimate.translations[view.frame];
    observation.E =
        RowAtRay(x_cam.hnormalized(), observation.E.bottomLeftCorner<2, 2>());
  }
  std::mt19937 generator(4);
  std::uniform_real_distribution<double> uniform(-0.02, 0.02);
  for (Eigen::Vector3d& t : scene.estimate.translations) {
    for (double& value : t) value += uniform(generator);
  }
  return scene;
}

void ExpectSameBits(const Estimate& a, const Estimate& b) {
  EXPECT_EQ(a.translations, b.translations);
  EXPECT_EQ(a.points, b.points);
}

// The largest residual of frame f.
double FrameCost(const KnownRotationProblem& problem, const Estimate& estimate,
                 int32_t f) {
  double cost = 0;
  for (int64_t n = problem.frame_begin[f]; n < problem.frame_begin[f + 1];
       ++n) {
    const Observation& observation =
        problem.observations[problem.frame_observations[n]];
    cost = std::max(cost, ResidualOf(ViewPoint(problem, observation, estimate),
                                     Norm::L2()));
  }
  return cost;
}

class ResIntTest : public testing::TestWithParam<FastDescentSettings> {
 protected:
  ResIntOptions Options() const {
    ResIntOptions options;
    options.fast_descent.settings = GetParam();
    options.max_sweeps = 30;
    options.sweep_tolerance = 1e-4;
    return options;
  }
};

TEST_P(ResIntTest, NeverRaisesTheCostAndReportsWhatItReached) {
  RandomScene scene = MakeScene(1);
  const double start = Cost(scene.problem, scene.estimate, Norm::L2(), 1);
  int callbacks = 0;
  ResIntOptions options = Options();
  options.callback = [&](int sweep, const Sweep&) {
    EXPECT_EQ(sweep, ++callbacks);
  };
  const ResIntSummary summary =
      SolveResInt(scene.problem, options, {}, &scene.estimate);
  EXPECT_EQ(summary.cost_initial, start);
  EXPECT_LT(summary.cost_final, summary.cost_initial);
  EXPECT_EQ(summary.cost_final,
            Cost(scene.problem, scene.estimate, Norm::L2(), 1));
  ASSERT_EQ(static_cast<int>(summary.sweeps.size()), callbacks);
  double previous = start;
  for (const Sweep& sweep : summary.sweeps) {
    EXPECT_LE(sweep.cost, previous);
    previous = sweep.cost;
  }
  EXPECT_NEAR(previous, summary.cost_final, kCostRounding);
}

TEST_P(ResIntTest, SaysStalledOnlyAfterIdleSweeps) {
  RandomScene scene = MakeScene(1);
  ResIntOptions options = Options();
  options.max_sweeps = 1000;
  const ResIntSummary summary =
      SolveResInt(scene.problem, options, {}, &scene.estimate);
  EXPECT_EQ(summary.termination, SolveTermination::kStalled);
  const size_t patience = GetParam() == FastDescentSettings::kPaper ? 1 : 3;
  const size_t n = summary.sweeps.size();
  ASSERT_GT(n, patience);
  for (size_t k = n - patience; k < n; ++k) {
    EXPECT_LE(summary.sweeps[k - 1].cost - summary.sweeps[k].cost,
              options.sweep_tolerance * summary.sweeps[k - 1].cost);
  }
}

TEST_P(ResIntTest, SaysMaxSweepsAfterSoMany) {
  RandomScene scene = MakeScene(1);
  ResIntOptions options = Options();
  options.max_sweeps = 2;
  const ResIntSummary summary =
      SolveResInt(scene.problem, options, {}, &scene.estimate);
  EXPECT_EQ(summary.termination, SolveTermination::kMaxSweeps);
  EXPECT_EQ(summary.sweeps.size(), 2u);
}

TEST_P(ResIntTest, NoSweepsChangeNothing) {
  const RandomScene scene = MakeScene(1);
  ResIntOptions options = Options();
  options.max_sweeps = 0;
  Estimate estimate = scene.estimate;
  const ResIntSummary summary =
      SolveResInt(scene.problem, options, {}, &estimate);
  EXPECT_EQ(summary.termination, SolveTermination::kMaxSweeps);
  EXPECT_EQ(summary.cost_final, summary.cost_initial);
  EXPECT_TRUE(summary.sweeps.empty());
  ExpectSameBits(estimate, scene.estimate);
}

TEST_P(ResIntTest, InterruptionKeepsTheBestSoFar) {
  RandomScene scene = MakeScene(1);
  CancelFlag cancel{false};
  ResIntOptions options = Options();
  options.callback = [&](int sweep, const Sweep&) { cancel = sweep == 2; };
  const ResIntSummary summary =
      SolveResInt(scene.problem, options, {1, &cancel}, &scene.estimate);
  EXPECT_EQ(summary.termination, SolveTermination::kInterrupted);
  ASSERT_EQ(summary.sweeps.size(), 2u);
  EXPECT_NEAR(summary.cost_final, summary.sweeps.back().cost, kCostRounding);
  EXPECT_EQ(Cost(scene.problem, scene.estimate, Norm::L2(), 1),
            summary.cost_final);
}

TEST_P(ResIntTest, TriangulationLeavesFramesAlone) {
  const RandomScene scene = MakeScene(1);
  ResIntOptions options = Options();
  options.update_frames = false;
  Estimate estimate = scene.estimate;
  const ResIntSummary summary =
      SolveResInt(scene.problem, options, {}, &estimate);
  EXPECT_EQ(estimate.translations, scene.estimate.translations);
  EXPECT_LT(summary.cost_final, summary.cost_initial);
}

TEST_P(ResIntTest, RefusesAStartBehindACamera) {
  RandomScene scene = MakeScene(1);
  scene.estimate.points[5].z() = -100;
  EXPECT_THROW(SolveResInt(scene.problem, Options(), {}, &scene.estimate),
               std::invalid_argument);
}

TEST_P(ResIntTest, RefusesOptionsOutOfRange) {
  RandomScene scene = MakeScene(1);
  ResIntOptions options = Options();
  options.max_sweeps = -1;
  EXPECT_THROW(SolveResInt(scene.problem, options, {}, &scene.estimate),
               std::invalid_argument);
  options = Options();
  options.norm.p = 0.5;
  EXPECT_THROW(SolveResInt(scene.problem, options, {}, &scene.estimate),
               std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(, ResIntTest,
                         testing::Values(FastDescentSettings::kFast,
                                         FastDescentSettings::kPaper),
                         [](const auto& parameter) {
                           return parameter.param == FastDescentSettings::kFast
                                      ? "Fast"
                                      : "Paper";
                         });

TEST(ResInt, NoiseFreeScenesComeOutNearlyExact) {
  RandomScene scene = MakeExactScene();
  ResIntOptions options;
  options.max_sweeps = 300;
  const ResIntSummary summary =
      SolveResInt(scene.problem, options, {}, &scene.estimate);
  EXPECT_LT(summary.cost_final, 1e-2 * summary.cost_initial);
}

// Earlier sweeps may be coarse; the last one ends at every frame's optimum.
TEST(ResInt, TheLastOfSoManySweepsLeavesFramesAtTheirOptima) {
  RandomScene scene = MakeScene(6);
  ResIntOptions options;
  options.max_sweeps = 3;
  SolveResInt(scene.problem, options, {}, &scene.estimate);
  Estimate again = scene.estimate;
  BlockSweep(scene.problem, FastDescentOptions{}, Norm::L2(), Context{1})
      .ResectFrames(&again);
  for (int32_t f = 0; f < scene.problem.num_frames; ++f) {
    EXPECT_NEAR(FrameCost(scene.problem, again, f),
                FrameCost(scene.problem, scene.estimate, f), 1e-9);
  }
}

// The same holds where the sweeps end by themselves.
TEST(ResInt, SweepsThatStallLeaveFramesAtTheirOptima) {
  RandomScene scene = MakeScene(6);
  ResIntOptions options;
  SolveResInt(scene.problem, options, {}, &scene.estimate);
  BlockSweep blocks(scene.problem, FastDescentOptions{}, Norm::L2(),
                    Context{1});
  Estimate again = scene.estimate;
  blocks.ResectFrames(&again);
  for (int32_t f = 0; f < scene.problem.num_frames; ++f) {
    EXPECT_NEAR(FrameCost(scene.problem, again, f),
                FrameCost(scene.problem, scene.estimate, f), 1e-9);
  }
}

TEST(BlockSweep, LeavesBlocksAtTheLevelOfTheGoalWhereTheyAre) {
  const RandomScene scene = MakeScene(7);
  BlockSweep blocks(scene.problem, FastDescentOptions{}, Norm::L2(),
                    Context{1});
  const double level = (1 + 1e-9) * FrameCost(scene.problem, scene.estimate, 0);
  blocks.SetGoal({1e-11, level});
  Estimate estimate = scene.estimate;
  blocks.ResectFrames(&estimate);
  for (int32_t f = 0; f < scene.problem.num_frames; ++f) {
    const bool is_above = FrameCost(scene.problem, scene.estimate, f) > level;
    EXPECT_EQ(estimate.translations[f] != scene.estimate.translations[f],
              is_above);
  }
}

TEST(BlockSweep, LeavesPointsAtTheLevelOfTheGoalWhereTheyAre) {
  const RandomScene scene = MakeScene(7);
  BlockSweep blocks(scene.problem, FastDescentOptions{}, Norm::L2(),
                    Context{1});
  const double level =
      (1 + 1e-9) * CostOf(scene.problem, scene.estimate, Norm::L2(),
                          scene.problem.OfPoint(0));
  blocks.SetGoal({1e-11, level});
  Estimate estimate = scene.estimate;
  blocks.IntersectPoints(&estimate);
  int num_moved = 0;
  for (int32_t k = 0; k < scene.problem.num_points; ++k) {
    const bool is_above = CostOf(scene.problem, scene.estimate, Norm::L2(),
                                 scene.problem.OfPoint(k)) > level;
    EXPECT_EQ(estimate.points[k] != scene.estimate.points[k], is_above);
    num_moved += is_above;
  }
  EXPECT_GT(num_moved, 0);
  EXPECT_LT(num_moved, scene.problem.num_points);
}

TEST(BlockSweep, ReturnsTheCostThatItReaches) {
  RandomScene scene = MakeScene(8);
  BlockSweep blocks(scene.problem, FastDescentOptions{}, Norm::L2(),
                    Context{2});
  for (const double level : {0.0, 3.0}) {
    blocks.SetGoal({1e-11, level});
    const double after_points = blocks.IntersectPoints(&scene.estimate);
    EXPECT_NEAR(after_points,
                Cost(scene.problem, scene.estimate, Norm::L2(), 1),
                kCostRounding);
    const double after_frames = blocks.ResectFrames(&scene.estimate);
    EXPECT_NEAR(after_frames,
                Cost(scene.problem, scene.estimate, Norm::L2(), 1),
                kCostRounding);
    EXPECT_LE(after_frames, after_points + kCostRounding);
  }
}

TEST(BlockSweep, OfAPointBehindACameraReturnsInfinity) {
  RandomScene scene = MakeScene(8);
  scene.estimate.points.front().z() = -100;
  for (const double level : {0.0, 3.0}) {
    BlockSweep blocks(scene.problem, FastDescentOptions{}, Norm::L2(),
                      Context{1});
    blocks.SetGoal({1e-11, level});
    Estimate estimate = scene.estimate;
    EXPECT_EQ(blocks.IntersectPoints(&estimate),
              std::numeric_limits<double>::infinity());
    estimate = scene.estimate;
    EXPECT_EQ(blocks.ResectFrames(&estimate),
              std::numeric_limits<double>::infinity());
  }
}

// Points are solved side by side; which ones they are together with is nothing
// to them.
TEST(BlockSweep, APointEndsAtTheSameBitsWhateverOthersThereAre) {
  const RandomScene scene = MakeScene(9);
  const DescentGoal goal{1e-3, 2.0};
  BlockSweep blocks(scene.problem, FastDescentOptions{}, Norm::L2(),
                    Context{1});
  blocks.SetGoal(goal);
  Estimate all = scene.estimate;
  blocks.IntersectPoints(&all);

  KnownRotationProblem part = scene.problem;  // without every third point
  Estimate some = scene.estimate;
  std::vector<int32_t> kept;
  for (int32_t k = 0; k < scene.problem.num_points; ++k) {
    if (k % 3 != 0) kept.push_back(k);
  }
  part.observations.clear();
  for (size_t n = 0; n < kept.size(); ++n) {
    some.points[n] = scene.estimate.points[kept[n]];
    for (int64_t i = scene.problem.point_begin[kept[n]];
         i < scene.problem.point_begin[kept[n] + 1]; ++i) {
      part.observations.push_back(scene.problem.observations[i]);
      part.observations.back().point = static_cast<int32_t>(n);
    }
  }
  part.num_points = static_cast<int32_t>(kept.size());
  some.points.resize(kept.size());
  IndexObservations(&part);
  BlockSweep part_blocks(part, FastDescentOptions{}, Norm::L2(), Context{1});
  part_blocks.SetGoal(goal);
  part_blocks.IntersectPoints(&some);
  for (size_t n = 0; n < kept.size(); ++n) {
    EXPECT_EQ(some.points[n], all.points[kept[n]]);
  }
}

// Every point is then at its own optimum for the frames as they are.
TEST(BlockSweep, ASecondIntersectionGainsNothing) {
  RandomScene scene = MakeScene(5);
  BlockSweep blocks(scene.problem, FastDescentOptions{}, Norm::L2(),
                    Context{1});
  blocks.IntersectPoints(&scene.estimate);
  const Estimate once = scene.estimate;
  blocks.IntersectPoints(&scene.estimate);
  for (int32_t k = 0; k < scene.problem.num_points; ++k) {
    double before = 0;
    double after = 0;
    for (int64_t i = scene.problem.point_begin[k];
         i < scene.problem.point_begin[k + 1]; ++i) {
      const Observation& observation = scene.problem.observations[i];
      before = std::max(
          before,
          ResidualOf(ViewPoint(scene.problem, observation, once), Norm::L2()));
      after = std::max(after, ResidualOf(ViewPoint(scene.problem, observation,
                                                   scene.estimate),
                                         Norm::L2()));
    }
    EXPECT_NEAR(after, before, 1e-9);
  }
}

}  // namespace
}  // namespace krot::internal
