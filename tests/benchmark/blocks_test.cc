// The sub-problems of real models that the benchmark measures, against the
// ellipsoid oracle: what is fast must be right.

#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "tests/oracle/ellipsoid_oracle.h"
#include "tools/benchmark/benchmark_model.h"
#include "tools/benchmark/subproblem_solver.h"

namespace krot::internal {
namespace {

constexpr double kRadius = 4;        // mean depths, about the start
constexpr double kAgreement = 1e-9;  // relative

class BlocksOfRealModels : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const char* root = std::getenv("KROT_REAL_MODELS");
    if (root == nullptr) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
    model_ = ReadBenchmarkModel(std::filesystem::path(root) / GetParam());
  }

  // `fast` at the oracle's optimum, and not above `paper`.
  void ExpectOptimum(const Subproblem& block) {
    const Norm norm = Norm::L2();
    const Eigen::Vector3d x = solvers_[0]->Minimize(block);
    const double fast = block.Cost(x, norm);
    const double paper = block.Cost(solvers_[1]->Minimize(block), norm);
    EXPECT_LE(fast, (1 + kAgreement) * paper);
    const OracleOptimum oracle =
        MinimizeByEllipsoids(block.residuals, norm, block.start, kRadius);
    EXPECT_NEAR(fast, oracle.cost, kAgreement * oracle.cost);
    // No point of the ball is better, and `fast` ended well inside.
    EXPECT_LE(fast - oracle.lower_bound, kAgreement * fast);
    EXPECT_LT((x - block.start).norm(), 0.9 * kRadius);
    ++num_blocks_;
  }

  BenchmarkModel model_;
  std::vector<std::unique_ptr<SubproblemSolver>> solvers_ =
      FastAndPaper(Norm::L2());
  int num_blocks_ = 0;
};

TEST_P(BlocksOfRealModels, HaveTheOptimumOfTheOracle) {
  const KnownRotationProblem& problem = model_.built.problem;
  const Estimate& start = model_.built.start;
  for (int32_t k = 0; k < problem.num_points; k += problem.num_points / 40) {
    const auto block =
        MakeBlock(IntersectionResiduals(problem, start, k), start.points[k]);
    if (block) ExpectOptimum(*block);
  }
  for (int32_t f = 0; f < problem.num_frames; f += 8) {
    const auto block =
        MakeBlock(ResectionResiduals(problem, start, f), start.translations[f]);
    if (block) ExpectOptimum(*block);
  }
  EXPECT_GT(num_blocks_, 30);
}

INSTANTIATE_TEST_SUITE_P(, BlocksOfRealModels,
                         testing::Values("crane8_txt", "fountain11", "south128",
                                         "tower_init", "task41_rigs_frames"),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace krot::internal
