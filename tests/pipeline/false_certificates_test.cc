#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <random>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "krot/convert/certificate_file.h"
#include "krot/pipeline/solve_model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

// Certificates that were tampered with, and true ones of problems nearby. The
// oracle is an estimate: a bound above its largest error is false, whatever
// the checker thinks. KROT_FALSE_CERTIFICATES models are tried (docs/
// reliability.md: 10,000).

namespace krot::internal {
namespace {

// Of the largest error, relative: what a claim must be above to be false.
constexpr double kBoundRounding = 1e-9;
constexpr double kProvedGap = 1e-6;

int NumModels() {
  const char* text = std::getenv("KROT_FALSE_CERTIFICATES");
  return text == nullptr ? 40 : std::atoi(text);
}

class Dice {
 public:
  explicit Dice(uint64_t seed) : random_(seed) {}
  size_t Below(size_t count) {
    return std::uniform_int_distribution<size_t>(0, count - 1)(random_);
  }
  // From 1e-5 to 1, of either sign.
  double Change() {
    const double decades = std::uniform_real_distribution<>(-5, 0)(random_);
    return (Below(2) == 0 ? 1 : -1) * std::pow(10, decades);
  }

 private:
  std::mt19937_64 random_;
};

Model ProvedScene(uint64_t seed) {
  SceneOptions options = SceneOf(4, 12, 3, 0.5);
  options.sensors_per_rig = seed % 3 == 0 ? 2 : 1;
  options.camera_model_id = seed % 2 == 0 ? 0 : 2;  // without a lens, with one
  options.start_point_noise = 0.002;
  options.random_seed = seed;
  return SynthesizeScene(options).model;
}

struct SolvedScene {
  double cost = 0;  // the largest error of an estimate
  CertificateFile certificate;
};

SolvedScene RunSolve(const Model& model) {
  SolveModelOptions options;
  options.joint.relative_gap = kProvedGap;
  options.finish.finish = Finish::kNone;
  options.describe_certificate = true;
  SolveModelResult result = SolveModel(model, options, {1});
  EXPECT_TRUE(result.summary.certificate);
  return {result.summary.cost_final,
          result.summary.certificate.value_or(CertificateFile())};
}

void Tamper(Dice* dice, CertificateFile* file) {
  auto& support = file->observations;
  const size_t i = dice->Below(support.size());
  auto& o = support[i];
  switch (dice->Below(9)) {
    case 0:
      file->lower_bound *= 1 + std::abs(dice->Change());
      break;
    case 1: {
      const double factor = 1 + std::abs(dice->Change());
      file->lower_bound *= factor;
      file->rows_bound *= factor;
      file->defect = 1e-6;
      break;
    }
    case 2:
      o.lambda *= 1 + dice->Change();
      break;
    case 3:
      o.y *= 1 + dice->Change();
      break;
    case 4:
      o.y[dice->Below(2)] += o.lambda * dice->Change();
      break;
    case 5:
      o.bearing[dice->Below(3)] += dice->Change();
      break;
    case 6:
      support.erase(support.begin() + static_cast<int64_t>(i));
      break;
    case 7:
      std::swap(o.y, support[(i + 1) % support.size()].y);
      break;
    default:
      o.point2D_idx ^= 1;
      break;
  }
}

// The same model but for a pixel, a lens, a rotation or a baseline; or another
// one with the same ids.
Model Neighbour(const Model& model, uint64_t seed, Dice* dice) {
  Model other = model;
  const double change = dice->Change();
  switch (dice->Below(4)) {
    case 0: {
      Image& image = other.images[dice->Below(other.images.size())];
      image.points2D[dice->Below(image.points2D.size())].x += 10 * change;
      break;
    }
    case 1:
      other.cameras[0].params[dice->Below(3)] *= 1 + 0.1 * change;
      break;
    case 2:
      other.frames[dice->Below(other.frames.size())]
          .rig_from_world.quaternion_wxyz[1] += 0.01 * change;
      break;
    default:
      return ProvedScene(seed + 3000000);
  }
  return other;
}

struct Count {
  int64_t tried = 0;
  int64_t refused = 0;
  int64_t false_ones = 0;  // accepted, though an estimate is below the bound

  void Add(const Model& model, const CertificateFile& file, double cost) {
    const CertificateVerdict verdict = VerifyCertificateFile(model, file);
    ++tried;
    refused += !verdict.is_accepted;
    false_ones += verdict.is_accepted &&
                  verdict.lower_bound > cost * (1 + kBoundRounding);
  }
};

void Print(const char* what, const Count& count) {
  std::cout << "| " << what << " | " << count.tried << " | " << count.refused
            << " | " << count.false_ones << " |\n";
}

TEST(FalseCertificates, AreNeverAcceptedAndTrueOnesAre) {
  constexpr int kTamperings = 10;
  Count whole, tampered, neighbours;
  Dice dice(1);
  for (int n = 0; n < NumModels(); ++n) {
    const auto seed = static_cast<uint64_t>(n);
    const Model model = ProvedScene(seed);
    const SolvedScene solved = RunSolve(model);
    ASSERT_FALSE(solved.certificate.observations.empty());
    whole.Add(model, solved.certificate, solved.cost);
    for (int k = 0; k < kTamperings; ++k) {
      CertificateFile file = solved.certificate;
      Tamper(&dice, &file);
      tampered.Add(model, file, solved.cost);
    }
    const Model other = Neighbour(model, seed, &dice);
    CertificateFile file = solved.certificate;
    file.model_sha256 = ModelSha256(other);
    neighbours.Add(other, file, RunSolve(other).cost);
  }
  std::cout << "| certificates | tried | refused | false, and accepted |\n"
            << "|---|---|---|---|\n";
  Print("true", whole);
  Print("tampered with", tampered);
  Print("of a problem nearby", neighbours);
  EXPECT_EQ(whole.refused, 0);
  EXPECT_EQ(tampered.false_ones, 0);
  EXPECT_EQ(neighbours.false_ones, 0);
  EXPECT_GT(tampered.refused, tampered.tried / 2);
}

}  // namespace
}  // namespace krot::internal
