#include "krot/convert/pixel_certificate.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/convert/lens_model.h"
#include "tests/convert/pixel_optimum.h"

namespace krot::internal {
namespace {

using ::testing::HasSubstr;

struct Lens {
  const char* name;
  int camera_model_id;
  std::vector<double> params;
  double p;
};

class PixelCertificateOf : public ::testing::TestWithParam<Lens> {
 protected:
  void SetUp() override {
    LensModelOptions options;
    options.camera_model_id = GetParam().camera_model_id;
    options.params = GetParam().params;
    options.num_points = 15;
    model_ = MakeLensModel(options);
    built_ = BuildProblem(model_, {});
    optimum_ = SolveInPixels(model_, norm(), &built_, /*num_steps=*/4);
    ASSERT_TRUE(optimum_.is_proved);
  }

  Norm norm() const { return {GetParam().p}; }

  PixelCertificateCheck Check(const PixelCertificate& certificate) const {
    const PixelCertificateCheck check =
        CheckPixelCertificate(model_, built_, norm(), certificate, {});
    EXPECT_NE(check.is_accepted, !check.refusal.empty());
    EXPECT_EQ(check.lower_bound,
              check.is_accepted ? certificate.lower_bound : 0);
    return check;
  }

  void ExpectRefused(const std::function<void(PixelCertificate*)>& change) {
    PixelCertificate certificate = optimum_.certificate;
    change(&certificate);
    EXPECT_FALSE(Check(certificate).is_accepted);
  }

  Model model_;
  BuiltProblem built_;
  PixelOptimum optimum_;
};

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const std::vector<double> kRadial = {500, 320, 240, -0.12};

INSTANTIATE_TEST_SUITE_P(
    Lenses, PixelCertificateOf,
    ::testing::Values(
        Lens{"SimpleRadial", 2, kRadial, 2},
        Lens{"SimpleRadialL1", 2, kRadial, 1},
        Lens{"SimpleRadialLInf", 2, kRadial, kInfinity},
        Lens{"Opencv", 4, {500, 490, 320, 240, -0.1, 0.01, 3e-3, -2e-3}, 2},
        Lens{"Fisheye", 8, {300, 320, 240, -0.05}, 2},
        Lens{"Panorama", 17, {2000, 1000}, 2}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_P(PixelCertificateOf, IsAcceptedAndReachesTheTrueOptimum) {
  const PixelCertificateCheck check = Check(optimum_.certificate);
  EXPECT_TRUE(check.is_accepted) << check.refusal;
  // A lens bends the straight sides of the other norms' balls.
  const double loss = GetParam().p == 2 ? 1e-4 : 1e-3;
  EXPECT_GE(check.lower_bound, (1 - loss) * optimum_.cost);
  EXPECT_LE(check.lower_bound, optimum_.cost);
}

TEST_P(PixelCertificateOf, DoesNotDependOnTheRowsThatWereBuilt) {
  for (Observation& observation : built_.problem.observations) {
    observation.E.setIdentity();
  }
  built_.start = Estimate();
  EXPECT_TRUE(Check(optimum_.certificate).is_accepted);
}

TEST_P(PixelCertificateOf, IsRefusedForAnyHigherBound) {
  ExpectRefused([](PixelCertificate* c) { c->lower_bound *= 1 + 1e-3; });
  ExpectRefused([](PixelCertificate* c) { c->lower_bound *= 1 + 1e-6; });
  ExpectRefused([](PixelCertificate* c) { c->lower_bound = INFINITY; });
  ExpectRefused([](PixelCertificate* c) { c->lower_bound = std::nan(""); });
  ExpectRefused([](PixelCertificate* c) { c->lower_bound = -1; });
  ExpectRefused([](PixelCertificate* c) {
    c->lower_bound *= 1 + 1e-3;
    c->rows.lower_bound *= 1 + 1e-3;
  });
}

TEST_P(PixelCertificateOf, IsLoweredALittleIfThatMakesItAccepted) {
  PixelCertificate certificate = optimum_.certificate;
  certificate.lower_bound *= 1 + 9e-7;
  ASSERT_FALSE(Check(certificate).is_accepted);
  const PixelCertificateCheck check =
      LowerUntilAccepted(model_, built_, norm(), {}, &certificate);
  EXPECT_TRUE(check.is_accepted) << check.refusal;
  EXPECT_EQ(check.lower_bound, certificate.lower_bound);
  EXPECT_GT(check.lower_bound, (1 - 1e-6) * optimum_.certificate.lower_bound);
  EXPECT_TRUE(Check(certificate).is_accepted);

  certificate.lower_bound *= 1 + 1e-5;
  EXPECT_FALSE(
      LowerUntilAccepted(model_, built_, norm(), {}, &certificate).is_accepted);
}

TEST_P(PixelCertificateOf, IsRefusedIfAnyNumberOfItChanges) {
  const size_t count = optimum_.certificate.bearings.size();
  double largest = 0;
  for (const CertifiedObservation& o : optimum_.certificate.rows.observations) {
    largest = std::max(largest, o.lambda);
  }
  for (size_t n = 0; n < count; ++n) {
    SCOPED_TRACE(n);
    ExpectRefused([&](PixelCertificate* c) {
      c->bearings[n] += 1e-5 * c->bearings[n].unitOrthogonal();
    });
    ExpectRefused([&](PixelCertificate* c) { c->bearings[n].setZero(); });
    ExpectRefused([&](PixelCertificate* c) {
      c->rows.observations[n].lambda += 1e-6 * largest;
    });
    ExpectRefused([&](PixelCertificate* c) {
      c->rows.observations[n].y[1] += 1e-6 * largest;
    });
    ExpectRefused(
        [&](PixelCertificate* c) { c->rows.observations[n].observation = -1; });
  }
  ExpectRefused([](PixelCertificate* c) { c->bearings.pop_back(); });
}

TEST_P(PixelCertificateOf, IsRefusedIfTheCameraOrAPixelDiffers) {
  Model original = model_;
  const int model_id = model_.cameras[0].model_id;
  const size_t num_params = model_.cameras[0].params.size();
  for (size_t n = 0; n < num_params; ++n) {
    model_.cameras[0].params[n] *= 1 + 1e-3;
    EXPECT_FALSE(Check(optimum_.certificate).is_accepted) << n;
    model_ = original;
  }
  if (model_id == 2) {
    model_.cameras[0].model_id = 8;
    EXPECT_FALSE(Check(optimum_.certificate).is_accepted);
    model_ = original;
  }
  const int64_t i = optimum_.certificate.rows.observations[0].observation;
  built_.pixels[i].x() += 1e-3;
  EXPECT_FALSE(Check(optimum_.certificate).is_accepted);
}

TEST_P(PixelCertificateOf, HoldsForEveryEstimateThatWasTried) {
  const Reprojection reprojection(model_, built_);
  std::mt19937 generator(7);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> exponent(-7, -2);
  const auto disturb = [&](double sigma, Eigen::Vector3d* x) {
    for (double& value : *x) value += sigma * normal(generator);
  };
  double lowest = std::numeric_limits<double>::infinity();
  for (int trial = 0; trial < 2000; ++trial) {
    Estimate estimate = optimum_.estimate;
    const double sigma = std::pow(10, exponent(generator));
    for (Eigen::Vector3d& t : estimate.translations) disturb(sigma, &t);
    for (Eigen::Vector3d& x : estimate.points) disturb(sigma, &x);
    double highest = 0;
    for (const CertifiedObservation& o :
         optimum_.certificate.rows.observations) {
      highest = std::max(highest,
                         reprojection.Error(estimate, norm(), o.observation));
    }
    lowest = std::min(lowest, highest);
  }
  EXPECT_GE(lowest, optimum_.certificate.lower_bound);
  EXPECT_LE(lowest, 1.01 * optimum_.cost);  // some were near
}

TEST(PixelCertificate, OfNoObservationsIsNotMade) {
  const Model model = MakeLensModel({});
  EXPECT_FALSE(MakePixelCertificate(model, BuildProblem(model, {}), Norm::L2(),
                                    Certificate(), {}, {}));
}

TEST(PixelCertificate, OfASupportBeyondAFoldIsNotMade) {
  LensModelOptions options;
  Model model = MakeLensModel(options);
  // Every pixel lies beyond what f (r + k r^3) reaches: no ray is its own.
  for (Image& image : model.images) {
    for (Point2D& point2D : image.points2D) point2D.x = 320 + 900;
  }
  BuiltProblem built = BuildProblem(model, {});
  ASSERT_FALSE(built.pixels.empty());
  const PixelOptimum optimum =
      SolveInPixels(model, Norm::L2(), &built, /*num_steps=*/1);
  EXPECT_FALSE(optimum.is_proved);
}

}  // namespace
}  // namespace krot::internal
