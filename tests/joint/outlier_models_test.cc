#include <gtest/gtest.h>

#include "krot/convert/build_problem.h"
#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

// Outliers of hundreds of pixels: points slide into cameras on the way down,
// the interior point stalls above the optimum, and few observations decide.
TEST(SolveJoint, ProvesTheOptimumOfModelsWithGrossOutliers) {
  for (const SceneLayout layout : {SceneLayout::kOrbit, SceneLayout::kStreet}) {
    for (const unsigned seed : {1u, 2u, 3u}) {
      SCOPED_TRACE(testing::Message()
                   << static_cast<int>(layout) << ", seed " << seed);
      SceneOptions scene = SceneOf(8, 200, 4, 0.5);
      scene.layout = layout;
      scene.outlier_ratio = 0.02;
      scene.random_seed = seed;
      const BuiltProblem built = BuildProblem(SynthesizeScene(scene).model, {});
      JointOptions options;
      options.relative_gap = 1e-4;
      Estimate estimate = built.start;
      const JointSummary summary =
          SolveJoint(built.problem, options, {}, &estimate);
      EXPECT_GT(summary.cost_final, 10);
      ASSERT_TRUE(summary.certificate);
      const CertificateCheck check =
          CheckCertificate(built.problem, options.norm, *summary.certificate);
      EXPECT_TRUE(check.is_accepted) << check.refusal;
      const double cost = Cost(built.problem, estimate, options.norm, 1);
      EXPECT_LE(check.proved_bound, cost);
      EXPECT_GE(check.proved_bound, (1 - options.relative_gap) * cost);
    }
  }
}

}  // namespace
}  // namespace krot::internal
