#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "krot/convert/build_problem.h"
#include "krot/joint/joint.h"
#include "krot/model/model_io.h"
#include "krot/problem/cost.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

// SolveJoint on real models against the optima of a reference solver.

constexpr double kReferenceGap = 1e-4;  // the reference's own, too

struct RealModel {
  const char* folder;
  double optimum;  // linearised pixels, p = 2
};

void PrintTo(const RealModel& model, std::ostream* stream) {
  *stream << model.folder;
}

std::string Name(const testing::TestParamInfo<RealModel>& test) {
  return test.param.folder;
}

class RealModelTest : public testing::TestWithParam<RealModel> {
 protected:
  void SetUp() override {
    const char* root = std::getenv("KROT_REAL_MODELS");
    if (root == nullptr) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
    const std::filesystem::path folder =
        std::filesystem::path(root) / GetParam().folder;
    built_ = BuildProblem(ReadModel(folder, DetectModelFormat(folder)), {});
  }

  void ExpectOptimumFrom(Estimate estimate) const {
    JointOptions options;
    options.relative_gap = kReferenceGap;
    const JointSummary summary =
        SolveJoint(built_.problem, options, {}, &estimate);
    EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
    const double optimum = GetParam().optimum;
    // Five digits are known.
    EXPECT_NEAR(summary.cost_final, optimum, 1e-4 * optimum + 5e-5);
    EXPECT_EQ(summary.cost_final,
              Cost(built_.problem, estimate, options.norm, 1));
    ASSERT_TRUE(summary.certificate);
    const CertificateCheck check =
        CheckCertificate(built_.problem, options.norm, *summary.certificate);
    EXPECT_TRUE(check.is_accepted) << check.refusal;
    EXPECT_GE(check.proved_bound, (1 - kReferenceGap) * summary.cost_final);
    EXPECT_LE(check.proved_bound, summary.cost_final);
    RecordProperty("iterations", static_cast<int>(summary.iterations.size()));
  }

  BuiltProblem built_;
};

using SolveJointOfRealModel = RealModelTest;

TEST_P(SolveJointOfRealModel, ProvesTheReferenceOptimumFromItsOwnStart) {
  ExpectOptimumFrom(built_.start);
}

INSTANTIATE_TEST_SUITE_P(
    Local, SolveJointOfRealModel,
    testing::Values(
        RealModel{"crane8_txt", 3.1011}, RealModel{"door", 4.3929},
        RealModel{"door_colmap", 3.4205}, RealModel{"fountain11", 3.2858},
        RealModel{"longtracks92", 3.4528}, RealModel{"maupertuis4_txt", 2.5369},
        RealModel{"outliers12", 18.9275}, RealModel{"room50_opencv", 3.6473},
        RealModel{"slow28", 2.8965}, RealModel{"south128", 3.1778},
        RealModel{"south128_full", 3.5773},
        RealModel{"task41_rigs_frames", 3.5041}, RealModel{"tower", 4.6315},
        RealModel{"tower_init", 4.6315}, RealModel{"two_cameras44", 2.9279}),
    Name);

using FindStartOfRealModel = RealModelTest;

TEST_P(FindStartOfRealModel, LeadsToTheReferenceOptimum) {
  Estimate estimate;
  const InitializerSummary start = FindStart(built_.problem, {}, {}, &estimate);
  ASSERT_EQ(start.termination, SolveTermination::kWithinBound);
  EXPECT_LT(Cost(built_.problem, estimate, Norm::L2(), 1),
            InitializerOptions().max_error);
  ExpectOptimumFrom(estimate);
}

INSTANTIATE_TEST_SUITE_P(Local, FindStartOfRealModel,
                         testing::Values(RealModel{"crane8_txt", 3.1011},
                                         RealModel{"fountain11", 3.2858},
                                         RealModel{"longtracks92", 3.4528},
                                         RealModel{"maupertuis4_txt", 2.5369},
                                         RealModel{"south128", 3.1778},
                                         RealModel{"task41_rigs_frames",
                                                   3.5041},
                                         RealModel{"two_cameras44", 2.9279}),
                         Name);

// Outliers of hundreds of pixels: points slide into cameras on the way down,
// the interior point stalls above the optimum, and few observations decide.
TEST(SolveJoint, ProvesTheOptimumOfModelsWithGrossOutliers) {
  for (const SceneLayout layout : {SceneLayout::kOrbit, SceneLayout::kStreet}) {
    for (const unsigned seed : {1u, 2u, 3u}) {
      SCOPED_TRACE(testing::Message()
                   << static_cast<int>(layout) << ", seed " << seed);
      SceneOptions scene = SceneOf(8, 200, 4, 0.5, seed);
      scene.layout = layout;
      scene.outlier_ratio = 0.02;
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
