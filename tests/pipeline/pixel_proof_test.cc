#include "krot/pipeline/stages.h"

#include <vector>

#include <gtest/gtest.h>

#include "krot/conic/interior_point.h"
#include "krot/convert/reprojection.h"
#include "krot/proof/certificate.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

// Where thousands of observations set the maximum, or are not told from those
// that do: the certificate is of rows at one estimate, the proof of those at
// another.
TEST(ProveRows, RepairsTheMultipliersOfALargeSupportForNewRows) {
  SceneOptions scene = SceneOf(40, 4000, 10, 1);
  scene.start_translation_noise = 0.003;
  scene.start_point_noise = 0.003;
  const Model model = SynthesizeScene(scene).model;
  const Norm norm = Norm::L2();
  BuiltProblem built = BuildProblem(model, {});
  const Reprojection reprojection(model, built);
  ASSERT_FALSE(reprojection.IsLinear());

  Estimate estimate = built.start;
  reprojection.TakeRows(estimate, 1, &built.problem);
  InteriorPointOptions options;
  options.smallest_gap = 1e-2;
  std::vector<Multiplier> multipliers;
  MinimizeJointly(built.problem, options, {}, &estimate, &multipliers);
  const double cost = reprojection.TrueCost(estimate, norm, 1);
  const double sufficient = 0.97 * cost;
  const std::optional<Certificate> found = RepairCertificate(
      built.problem, norm, estimate, multipliers, {sufficient}, {});
  ASSERT_TRUE(found);
  ASSERT_GT(found->observations.size(), 20000U);
  Context threads;
  threads.num_threads = 3;
  const std::optional<Certificate> again = RepairCertificate(
      built.problem, norm, estimate, multipliers, {sufficient}, threads);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->lower_bound, found->lower_bound);

  reprojection.TakeRows(estimate, 1, &built.problem);
  SolveModelOptions solve;
  solve.norm = norm;
  const std::optional<PixelCertificate> proof =
      ProveRows(model, built, estimate, solve, {*found, {}}, sufficient, {});
  ASSERT_TRUE(proof);
  const PixelCertificateCheck check =
      CheckPixelCertificate(model, built, norm, *proof, {});
  EXPECT_TRUE(check.is_accepted) << check.refusal;
  EXPECT_GE(check.lower_bound, 0.96 * cost);
  EXPECT_LE(check.lower_bound, cost);
}

}  // namespace
}  // namespace krot::internal
