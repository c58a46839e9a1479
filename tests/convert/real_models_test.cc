#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "krot/convert/build_problem.h"
#include "krot/convert/certificate_file.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/problem/cost.h"
#include "tests/convert/model_difference.h"
#include "tests/convert/pixel_optimum.h"
#include "tests/verify/naive_certificate_check.h"

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
  EXPECT_EQ(ModelDifference(model, ApplyEstimate(model, built, built.start),
                            /*ignore_geometry=*/false),
            "");
}

INSTANTIATE_TEST_SUITE_P(
    Local, BuildProblemOfRealModel,
    ::testing::Values(CountedModel{"crane8_txt", 6037, 3.995},
                      CountedModel{"room50_opencv", 55090, 4.368},
                      CountedModel{"task41_rigs_frames", 20785, 3.9919},
                      CountedModel{"longtracks92", 39489, 3.9860},
                      CountedModel{"tower", 169618, 8.682}),
    [](const auto& test) { return std::string(test.param.folder); });

struct RealModel {
  const char* folder;
  double optimum;  // pixels, from a reference solver, to 1e-4
};

class CertificateOfRealModel : public ::testing::TestWithParam<RealModel> {};

TEST_P(CertificateOfRealModel, ProvesTheReferenceOptimum) {
  const char* root = std::getenv("KROT_REAL_MODELS");
  if (root == nullptr) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  const std::filesystem::path folder =
      std::filesystem::path(root) / GetParam().folder;
  const Model model = ReadModel(folder, DetectModelFormat(folder));
  BuiltProblem built = BuildProblem(model, {});
  const PixelOptimum optimum =
      SolveInPixels(model, Norm::L2(), &built, /*num_steps=*/2);
  ASSERT_TRUE(optimum.is_proved);
  const NaiveCheck naive =
      CheckNaively(built.problem, 2, optimum.certificate.rows);
  EXPECT_LE(naive.longest, 1 + 1e-12);
  EXPECT_LE(naive.term, 1e-6);

  const CertificateFile file =
      ParseCertificate(CertificateJson(DescribeCertificate(
                           model, built, Norm::L2(), optimum.certificate)),
                       "c.json");
  const CertificateVerdict verdict = VerifyCertificateFile(model, file);
  EXPECT_TRUE(verdict.is_accepted) << verdict.refusal;
  EXPECT_NEAR(verdict.lower_bound, GetParam().optimum,
              1e-4 * GetParam().optimum);
}

INSTANTIATE_TEST_SUITE_P(Local, CertificateOfRealModel,
                         ::testing::Values(RealModel{"crane8_txt", 3.1011},
                                           RealModel{"maupertuis4_txt", 2.5369},
                                           RealModel{"two_cameras44", 2.9279},
                                           RealModel{"south128", 3.1778}),
                         [](const auto& test) {
                           return std::string(test.param.folder);
                         });

}  // namespace
}  // namespace krot::internal
