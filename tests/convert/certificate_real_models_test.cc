#include <cstdlib>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "krot/convert/certificate_file.h"
#include "krot/model/model_io.h"
#include "tests/convert/pixel_optimum.h"
#include "tests/verify/naive_certificate_check.h"

namespace krot::internal {
namespace {

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
