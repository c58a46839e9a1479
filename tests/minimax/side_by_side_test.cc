// Problems solved eight at a time against the same ones solved alone.

#include "krot/minimax/fast_descent.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <gtest/gtest.h>

#include "tests/oracle/ellipsoid_oracle.h"
#include "tests/testing/random_residuals.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr double kSideBySideAgreement = 1e-9;  // pixels

struct Task {
  ResidualProblem problem;
  Vector3d x;
  ActiveResiduals active;
  DescentSummary summary;
};

using Tasks = std::vector<Task>;

void SolveAlone(const DescentGoal& goal, Norm norm, Tasks* tasks) {
  FastDescent descent(FastDescentOptions{}, norm);
  for (Task& task : *tasks) {
    Fill(task.problem, &descent.residuals());
    task.summary = descent.Minimize(goal, &task.active, &task.x);
  }
}

void SolveSideBySide(const DescentGoal& goal, SideBySideDescent* descent,
                     Tasks* tasks) {
  std::vector<SideBySideDescent::Problem> problems;
  for (Task& task : *tasks) problems.push_back({&task.x, &task.active});
  descent->Minimize(
      goal,
      [&](int n, SideBySideDescent::RowWriter* writer) {
        for (const Residual& residual : (*tasks)[n].problem.residuals) {
          double row[kResidualRow];
          RowOf(residual, row);
          writer->Add(row);
        }
      },
      &problems);
  for (size_t n = 0; n < tasks->size(); ++n) {
    (*tasks)[n].summary = problems[n].summary;
  }
}

Tasks SideBySide(const DescentGoal& goal, Tasks tasks, Norm norm = Norm::L2()) {
  SideBySideDescent descent(FastDescentOptions{}, norm);
  SolveSideBySide(goal, &descent, &tasks);
  return tasks;
}

Tasks Alone(const DescentGoal& goal, Tasks tasks, Norm norm = Norm::L2()) {
  SolveAlone(goal, norm, &tasks);
  return tasks;
}

// `count` triangulations of 1, 2, ..., `max_rays` rays, in random order.
Tasks RandomTasks(unsigned seed, int count, int max_rays, double distance,
                  double noise_px = 5) {
  ProblemGenerator generator(seed);
  Tasks tasks(count);
  for (Task& task : tasks) {
    const int rays = 1 + static_cast<int>(max_rays * generator.Uniform());
    task.problem = generator.Triangulation(rays, noise_px);
    task.x = generator.Start(task.problem, distance);
  }
  return tasks;
}

void ExpectSameBits(const Task& a, const Task& b) {
  EXPECT_EQ(a.x, b.x);
  EXPECT_EQ(a.summary.cost, b.summary.cost);
  EXPECT_EQ(a.summary.cost_initial, b.summary.cost_initial);
  EXPECT_EQ(a.summary.iterations, b.summary.iterations);
  EXPECT_EQ(a.summary.termination, b.summary.termination);
  ASSERT_EQ(a.active.size, b.active.size);
  for (int k = 0; k < a.active.size; ++k) {
    EXPECT_EQ(a.active.index[k], b.active.index[k]);
    EXPECT_EQ(a.active.multiplier[k], b.active.multiplier[k]);
  }
}

void ExpectSameOptimum(const Tasks& starts, const Tasks& side_by_side,
                       const Tasks& alone) {
  for (size_t n = 0; n < starts.size(); ++n) {
    SCOPED_TRACE(n);
    const ResidualProblem& problem = starts[n].problem;
    const DescentSummary& summary = side_by_side[n].summary;
    const double start = problem.Cost(starts[n].x, Norm::L2());
    EXPECT_NEAR(summary.cost, alone[n].summary.cost,
                kSideBySideAgreement * std::max(1.0, alone[n].summary.cost));
    EXPECT_NEAR(summary.cost_initial, start, 1e-12 * start);
    EXPECT_LE(summary.cost, summary.cost_initial);
    EXPECT_NEAR(problem.Cost(side_by_side[n].x, Norm::L2()), summary.cost,
                kSideBySideAgreement);
  }
}

TEST(SideBySide, EveryProblemEndsAtTheOptimumThatItHasAlone) {
  for (const double distance : {0.02, 0.3, 1.5}) {
    for (const double noise_px : {0.5, 5.0, 30.0}) {
      const Tasks tasks = RandomTasks(1, 700, 25, distance, noise_px);
      const Tasks together = SideBySide(DescentGoal{}, tasks);
      ExpectSameOptimum(tasks, together, Alone(DescentGoal{}, tasks));
      for (const Task& task : together) {
        EXPECT_TRUE(task.summary.termination ==
                        DescentTermination::kStationary ||
                    task.summary.termination == DescentTermination::kZeroCost);
      }
    }
  }
}

TEST(SideBySide, OptimaAreThoseOfTheOracle) {
  const Tasks tasks = SideBySide(DescentGoal{}, RandomTasks(2, 150, 12, 0.3));
  for (const Task& task : tasks) {
    const OracleOptimum oracle = MinimizeByEllipsoids(
        task.problem.residuals, Norm::L2(), task.x, /*radius=*/20);
    EXPECT_NEAR(task.summary.cost, oracle.cost, kSideBySideAgreement);
  }
}

TEST(SideBySide, AWarmStartRightOrWrongLeadsToTheSameOptimum) {
  Tasks tasks = RandomTasks(3, 400, 20, 0.3);
  const Tasks cold = SideBySide(DescentGoal{}, tasks);
  int cold_steps = 0;
  int warm_steps = 0;
  for (size_t n = 0; n < tasks.size(); ++n) {
    tasks[n].active = cold[n].active;
    cold_steps += cold[n].summary.iterations;
  }
  const Tasks warm = SideBySide(DescentGoal{}, tasks);
  ExpectSameOptimum(tasks, warm, cold);
  for (const Task& task : warm) warm_steps += task.summary.iterations;
  EXPECT_LT(warm_steps, cold_steps);

  for (Task& task : tasks) {
    const int last = static_cast<int>(task.problem.residuals.size()) - 1;
    task.active = {};
    task.active.size = std::min(last + 1, 2);
    task.active.index[0] = last;
    task.active.index[1] = 0;
    task.active.multiplier[0] = 0.7F;
    task.active.multiplier[1] = 0.3F;
  }
  ExpectSameOptimum(tasks, SideBySide(DescentGoal{}, tasks), cold);
}

TEST(SideBySide, NeighboursAndOrderChangeNoBit) {
  for (const double tolerance : {1e-11, 1e-3}) {
    DescentGoal goal;
    goal.tolerance = tolerance;
    Tasks tasks = RandomTasks(4, 300, 30, 0.5);
    // Some with warm starts, some too long for lanes, one behind a camera.
    SolveAlone({1e-2}, Norm::L2(), &tasks);
    for (size_t n = 0; n < tasks.size(); n += 3) tasks[n].active = {};
    ProblemGenerator generator(5);
    tasks[70].problem = generator.Triangulation(200, 5);
    tasks[70].x = generator.Start(tasks[70].problem, 0.1);
    tasks[70].active = {};
    tasks[90].x = Vector3d(1e3, 1e3, 1e3);
    const Tasks together = SideBySide(goal, tasks);

    std::vector<int> order(tasks.size());
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), std::mt19937(6));
    Tasks shuffled;
    for (const int n : order) shuffled.push_back(tasks[n]);
    shuffled = SideBySide(goal, shuffled);
    for (size_t n = 0; n < order.size(); ++n) {
      ExpectSameBits(shuffled[n], together[order[n]]);
    }
    for (size_t n = 0; n < tasks.size(); n += 7) {
      ExpectSameBits(SideBySide(goal, {tasks[n]}).front(), together[n]);
    }
  }
}

TEST(SideBySide, ASecondCallDoesNotRememberTheFirst) {
  SideBySideDescent descent(FastDescentOptions{}, Norm::L2());
  const Tasks tasks = RandomTasks(7, 50, 20, 0.3);
  Tasks first = tasks;
  SolveSideBySide(DescentGoal{}, &descent, &first);
  Tasks second(tasks.begin() + 20, tasks.end());
  SolveSideBySide(DescentGoal{}, &descent, &second);
  for (size_t n = 0; n < second.size(); ++n) {
    ExpectSameBits(second[n], first[n + 20]);
  }
}

// How far a coarse descent ends above the optimum, on average, relative.
double MeanExcess(const Tasks& coarse, const Tasks& fine) {
  double sum = 0;
  for (size_t n = 0; n < fine.size(); ++n) {
    const double optimum = fine[n].summary.cost;
    const double excess = coarse[n].summary.cost - optimum;
    EXPECT_GE(excess, -kSideBySideAgreement);
    sum += excess / std::max(optimum, 1e-3);
  }
  return sum / static_cast<double>(fine.size());
}

TEST(SideBySide, ACoarseGoalIsReachedWithFewerStepsAndAsCloselyAsAlone) {
  DescentGoal goal;
  goal.tolerance = 1e-3;
  const Tasks tasks = RandomTasks(8, 2000, 20, 0.1);
  const Tasks fine = SideBySide(DescentGoal{}, tasks);
  const Tasks coarse = SideBySide(goal, tasks);
  const double excess = MeanExcess(coarse, fine);
  EXPECT_LE(excess, 1.2 * MeanExcess(Alone(goal, tasks), fine));
  EXPECT_LE(excess, 0.1 * goal.tolerance);
  const auto count_steps = [](const Tasks& ends) {
    int count = 0;
    for (const Task& task : ends) count += task.summary.iterations;
    return count;
  };
  EXPECT_LT(count_steps(coarse), count_steps(fine));
}

TEST(SideBySide, AStartAtTheLevelStaysAndAStepThatSufficesIsTheLast) {
  const Tasks tasks = RandomTasks(9, 200, 20, 0.1);
  const Tasks fine = SideBySide(DescentGoal{}, tasks);
  DescentGoal level;
  level.level = 50;
  DescentGoal sufficient;
  sufficient.sufficient = 50;
  const Tasks low = SideBySide(level, tasks);
  const Tasks early = SideBySide(sufficient, tasks);
  int num_low = 0;
  for (size_t n = 0; n < tasks.size(); ++n) {
    if (low[n].summary.cost_initial <= level.level) {
      ++num_low;
      EXPECT_EQ(low[n].summary.termination, DescentTermination::kLowEnough);
      EXPECT_EQ(low[n].x, tasks[n].x);
      EXPECT_EQ(low[n].active.size, 0);
      ExpectSameBits(low[n], early[n]);
    } else {
      ExpectSameBits(low[n], fine[n]);
      EXPECT_LE(early[n].summary.cost,
                std::max(sufficient.sufficient, fine[n].summary.cost));
      EXPECT_LE(early[n].summary.iterations, fine[n].summary.iterations);
    }
  }
  EXPECT_GT(num_low, 10);
  EXPECT_LT(num_low, 190);
}

TEST(SideBySide, AStartBehindACameraStays) {
  Tasks tasks = RandomTasks(10, 20, 10, 0.1);
  for (size_t n = 0; n < tasks.size(); n += 2) {
    const Residual& ray = tasks[n].problem.residuals.front();
    tasks[n].x -= 100 * ray.c;
  }
  const Tasks ends = SideBySide(DescentGoal{}, tasks);
  for (size_t n = 0; n < tasks.size(); ++n) {
    if (n % 2 == 1) {
      EXPECT_LT(ends[n].summary.cost, std::numeric_limits<double>::infinity());
      continue;
    }
    EXPECT_EQ(ends[n].summary.termination, DescentTermination::kBehind);
    EXPECT_EQ(ends[n].summary.cost, std::numeric_limits<double>::infinity());
    EXPECT_EQ(ends[n].x, tasks[n].x);
  }
}

// Without noise, repeated, doubled, along a line through all centres, and none.
Tasks NastyTasks() {
  ProblemGenerator generator(11);
  Tasks tasks;
  const auto add = [&](const ResidualProblem& problem, double distance) {
    tasks.push_back({problem, generator.Start(problem, distance), {}, {}});
  };
  for (int instance = 0; instance < 40; ++instance) {
    add(generator.Triangulation(2 + instance % 7, 0), 0.5);
    add(generator.Resection(1 + instance % 9, 5), 0.5);
    ResidualProblem repeated = generator.Triangulation(5, 5);
    for (int i = 0; i < 10; ++i) {
      repeated.residuals.push_back(repeated.residuals[i % 3]);
    }
    add(repeated, 0.5);
    ResidualProblem twins = generator.Triangulation(1, 0);
    Residual twin = twins.residuals[0];
    const Eigen::Vector2d offset(6, 4);
    twin.A += offset * twin.c.transpose();
    twin.b += offset * twin.d;
    twins.residuals.push_back(twin);
    add(twins, 0.5);
    add(generator.Triangulation(6, 1000), 0.3);
  }
  tasks.push_back({{}, Vector3d(1, 2, 3), {}, {}});
  return tasks;
}

TEST(SideBySide, NastyProblemsEndNoHigherThanAlone) {
  const Tasks tasks = NastyTasks();
  const Tasks together = SideBySide(DescentGoal{}, tasks);
  const Tasks alone = Alone(DescentGoal{}, tasks);
  for (size_t n = 0; n < tasks.size(); ++n) {
    SCOPED_TRACE(n);
    EXPECT_LE(together[n].summary.cost, together[n].summary.cost_initial);
    EXPECT_LE(together[n].summary.cost,
              alone[n].summary.cost +
                  kSideBySideAgreement * std::max(1.0, alone[n].summary.cost));
  }
}

// Both cameras see the same point of the sky: the infimum is at infinity.
TEST(SideBySide, AnOptimumAtInfinityIsFoundToBeFarAway) {
  ProblemGenerator generator(12);
  Tasks tasks;
  for (int instance = 0; instance < 20; ++instance) {
    const Eigen::Matrix3d R =
        generator.RotationTowardsOrigin(generator.Normal3());
    ResidualProblem problem;
    for (int i = 0; i < 3; ++i) {
      Residual ray;
      ray.A = 1000 * R.topRows<2>();
      ray.b = 1000 * Eigen::Vector2d(generator.Normal(), generator.Normal());
      ray.c = R.row(2);
      ray.d = 10;
      problem.residuals.push_back(ray);
    }
    tasks.push_back({problem, Vector3d::Zero(), {}, {}});
  }
  const Tasks together = SideBySide(DescentGoal{}, tasks);
  const Tasks alone = Alone(DescentGoal{}, tasks);
  for (size_t n = 0; n < tasks.size(); ++n) {
    ExpectSameBits(together[n], alone[n]);
    EXPECT_EQ(together[n].summary.termination, DescentTermination::kFarAway);
  }
}

TEST(SideBySide, OtherNormsAreSolvedAlone) {
  for (const double p : {1.0, 1.5, 3.0, Norm::LInf().p}) {
    const Tasks tasks = RandomTasks(13, 30, 10, 0.3);
    const Tasks together = SideBySide(DescentGoal{}, tasks, {p});
    const Tasks alone = Alone(DescentGoal{}, tasks, {p});
    for (size_t n = 0; n < tasks.size(); ++n) {
      ExpectSameBits(together[n], alone[n]);
    }
  }
}

TEST(SideBySide, RefusesOptionsOutOfRange) {
  FastDescentOptions options;
  options.max_iterations = 0;
  EXPECT_THROW(SideBySideDescent(options, Norm::L2()), std::invalid_argument);
  EXPECT_THROW(SideBySideDescent(FastDescentOptions{}, {0.5}),
               std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
