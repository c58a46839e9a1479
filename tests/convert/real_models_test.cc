#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "krot/convert/build_problem.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/problem/cost.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

struct CountedModel {
  const char* folder;
  int64_t num_observations;  // all of them usable
  double cost;               // pixels, from a reference solver
};

class BuildProblemOfRealModel : public ::testing::TestWithParam<CountedModel> {
};

TEST_P(BuildProblemOfRealModel, KeepsEverythingAndAgreesOnTheCost) {
  const char* root = std::getenv("KROT_REAL_MODELS");
  if (root == nullptr) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  const std::filesystem::path folder =
      std::filesystem::path(root) / GetParam().folder;
  const Model model = ReadModel(folder, DetectModelFormat(folder));
  ValidateModel(model);
  const BuiltProblem built = BuildProblem(model, {});
  EXPECT_EQ(static_cast<int64_t>(built.problem.observations.size()),
            GetParam().num_observations);
  EXPECT_NEAR(Cost(built.problem, built.start, Norm::L2(), -1), GetParam().cost,
              6e-4);
  EXPECT_THAT(ApplyEstimate(model, built, built.start), IsModel(model));
}

INSTANTIATE_TEST_SUITE_P(
    Local, BuildProblemOfRealModel,
    ::testing::Values(CountedModel{"crane8_txt", 6037, 3.995},
                      CountedModel{"room50_opencv", 55090, 4.368},
                      CountedModel{"task41_rigs_frames", 20785, 3.9919},
                      CountedModel{"longtracks92", 39489, 3.9860},
                      CountedModel{"tower", 169618, 8.682}),
    [](const auto& test) { return std::string(test.param.folder); });

}  // namespace
}  // namespace krot::internal
