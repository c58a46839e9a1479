#include "krot/camera/remainder_bound.h"

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "tests/camera/random_camera.h"

namespace krot::internal {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double NormOf(const Eigen::Vector2d& v, double p) {
  if (p == 1) return v.lpNorm<1>();
  return p == 2 ? v.norm() : v.lpNorm<Eigen::Infinity>();
}

struct Trial {
  Eigen::Vector2d pixel;
  Eigen::Vector3d x_hat;
  double level_px;
  double p;
};

// A pixel with a ray up to `max_angle` off the axis, and a point up to a level
// or so away from it.
std::optional<Trial> DrawTrial(Intrinsics intrinsics, double max_angle,
                               std::mt19937* random) {
  constexpr double kNorms[] = {1, 2, kInfinity};
  std::uniform_real_distribution<double> unit(0, 1);
  Trial trial;
  trial.level_px = 1 + 9 * unit(*random);
  trial.p = kNorms[(*random)() % 3];
  const Eigen::Vector3d bearing = RandomBearing(max_angle, random);
  const auto pixel = ProjectPoint(intrinsics, bearing);
  if (!pixel) return std::nullopt;
  trial.pixel = *pixel;
  const auto x_hat = PixelBearing(
      intrinsics, *pixel + 1.2 * trial.level_px * RandomRay(1, random),
      bearing);
  if (!x_hat) return std::nullopt;
  trial.x_hat = *x_hat;
  return trial;
}

// v / w at 10^4 rays of the region: along 100 ways, straight in the image, from
// the pixel's own ray to the border of |f| <= level, each ray by Newton's steps
// from the one before. A way ends where these lose it; where there is a region,
// none should.
std::vector<Eigen::Vector2d> SampleLinearErrors(Intrinsics intrinsics,
                                                const Trial& trial,
                                                std::mt19937* random) {
  constexpr int kNumWays = 100;
  constexpr int kRaysPerWay = 100;
  constexpr double kOnTheWay = 1e-6;  // pixels
  const Eigen::Matrix3d E =
      *RowAtProjection(intrinsics, trial.pixel, trial.x_hat);
  const auto pixels_ray = PixelBearing(intrinsics, trial.pixel, trial.x_hat);
  std::vector<Eigen::Vector2d> errors;
  for (int way = 0; way < kNumWays && pixels_ray; ++way) {
    Eigen::Vector2d end = RandomRay(1, random);
    if (way < 8) {  // the corners of every norm's ball
      end = {std::round(std::cos(way * kPi / 4)),
             std::round(std::sin(way * kPi / 4))};
    }
    end *= (1 - 1e-9) * trial.level_px / NormOf(end, trial.p);
    Eigen::Vector3d ray = *pixels_ray;
    for (int n = 1; n <= kRaysPerWay; ++n) {
      const Eigen::Vector2d target = n * end / kRaysPerWay;
      auto error = ProjectionError(intrinsics, trial.pixel, ray);
      for (int step = 0; step < 5 && error; ++step) {
        if ((*error - target).norm() <= kOnTheWay) break;
        const Chart chart = *ChartAt(intrinsics, ray);
        const Eigen::Matrix2d J = ChartJacobian(intrinsics, chart, ray);
        ray = (ray / chart.n.dot(ray) +
               chart.B * (J.inverse() * (target - *error)))
                  .normalized();
        error = ProjectionError(intrinsics, trial.pixel, ray);
      }
      if (!error || !((*error - target).norm() <= kOnTheWay)) break;
      if (NormOf(*error, trial.p) > trial.level_px) continue;
      const Eigen::Vector3d row = E * ray;
      EXPECT_GT(row[0], 0);
      errors.push_back(row.tail<2>() / row[0]);
    }
  }
  EXPECT_GE(errors.size(), 0.99 * kNumWays * kRaysPerWay);
  return errors;
}

// The largest |v / w| / level of the sample; -1 below it are none.
double SampleKappa(Intrinsics intrinsics, const Trial& trial,
                   std::mt19937* random) {
  double largest = 0;
  for (const Eigen::Vector2d& error :
       SampleLinearErrors(intrinsics, trial, random)) {
    largest = std::max(largest, NormOf(error, trial.p) / trial.level_px);
  }
  return largest - 1;
}

// Panoramas and fisheyes up to where they see, others up to 52 degrees.
double LargestAngle(int model_id) {
  if (model_id == 17) return kPi;
  const bool perspective = model_id <= 4 || model_id == 6;
  return model_id == 11 || perspective ? 0.9 : 1.9;
}

class RemainderBoundOf : public testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(EveryModel, RemainderBoundOf, testing::Range(0, 18),
                         [](const auto& model) {
                           return ModelName(model.param);
                         });

// Parameters up to six times as strong as those of RandomCamera: folds are
// near.
std::vector<double> StrongParams(int model_id, std::mt19937* random) {
  std::vector<double> params = RandomCamera(model_id, random).params();
  const std::string_view names = FindCameraModel(model_id)->param_names;
  const double factor = 1 + 5 * RandomRay(1, random).norm();
  size_t index = 0;
  for (size_t at = 0; at != std::string_view::npos; ++index) {
    at = at == 0 ? 0 : at + 2;
    const std::string_view name = names.substr(at, 2);
    if (name[0] == 'k' && name != "k4" && name != "k5" && name != "k6") {
      params[index] *= factor;
    }
    at = names.find(", ", at);
  }
  return params;
}

TEST_P(RemainderBoundOf, IsNeverExceededAndNearlyReached) {
  std::mt19937 random(1);
  int num_bounded = 0;
  for (int i = 0; i < 36; ++i) {
    const bool is_strong = i % 2 == 1;
    const std::vector<double> params =
        is_strong ? StrongParams(GetParam(), &random)
                  : RandomCamera(GetParam(), &random).params();
    const auto trial = DrawTrial({GetParam(), params.data()},
                                 LargestAngle(GetParam()), &random);
    if (!trial) continue;
    const auto bound = [&](double sufficient) {
      return RemainderBound({GetParam(), params.data()}, trial->pixel,
                            trial->x_hat, trial->level_px, trial->p,
                            sufficient);
    };
    const auto kappa = bound(0);
    if (!kappa) continue;
    ++num_bounded;
    const double sampled =
        SampleKappa({GetParam(), params.data()}, *trial, &random);
    EXPECT_LE(sampled, *kappa + 1e-9);
    const auto sufficient = bound(0.1);
    ASSERT_TRUE(sufficient);
    EXPECT_LE(sampled, *sufficient + 1e-9);
    EXPECT_LE(*sufficient, std::max(0.1, *kappa));
    if (is_strong) continue;
    EXPECT_LE(*kappa, 2 * std::max(sampled, 0.0) + 1e-4)
        << "trial " << i << ", level " << trial->level_px << ", p " << trial->p;
  }
  EXPECT_GT(num_bounded, 10);
}

double DualNormOf(const Eigen::Vector2d& y, double p) {
  return NormOf(y, p == 1 ? kInfinity : p == 2 ? 2 : 1);
}

TEST_P(RemainderBoundOf, InOneDirectionIsNeverExceeded) {
  std::mt19937 random(2);
  int num_bounded = 0;
  for (int i = 0; i < 30; ++i) {
    const std::vector<double> params = StrongParams(GetParam(), &random);
    const auto trial = DrawTrial({GetParam(), params.data()},
                                 LargestAngle(GetParam()), &random);
    if (!trial) continue;
    const Eigen::Vector2d y = 3 * RandomRay(1, &random);
    const auto bound = SupportBound({GetParam(), params.data()}, trial->pixel,
                                    trial->x_hat, y, trial->level_px, trial->p);
    if (!bound) continue;
    ++num_bounded;
    double largest = 0;
    for (const Eigen::Vector2d& error :
         SampleLinearErrors({GetParam(), params.data()}, *trial, &random)) {
      largest = std::max(largest, -y.dot(error));
    }
    EXPECT_LE(largest, *bound + 1e-8 * y.norm());  // of the rays' rounding
  }
  EXPECT_GT(num_bounded, 6);
}

TEST_P(RemainderBoundOf, InOneDirectionIsTheSameWhereNothingIsSufficient) {
  std::mt19937 random(4);
  int num_bounded = 0;
  for (int i = 0; i < 20; ++i) {
    const std::vector<double> params = StrongParams(GetParam(), &random);
    const auto trial = DrawTrial({GetParam(), params.data()},
                                 LargestAngle(GetParam()), &random);
    if (!trial) continue;
    const Eigen::Vector2d y = 3 * RandomRay(1, &random);
    const auto bound = [&](double sufficient) {
      return SupportBound({GetParam(), params.data()}, trial->pixel,
                          trial->x_hat, y, trial->level_px, trial->p,
                          sufficient);
    };
    const auto smallest = bound(0);
    if (!smallest) continue;
    ++num_bounded;
    EXPECT_EQ(bound(0.9 * *smallest), smallest);
    const double sufficient = 1.1 * *smallest;
    ASSERT_TRUE(bound(sufficient));
    EXPECT_LE(*bound(sufficient), sufficient);
    EXPECT_GE(*bound(sufficient), *smallest * (1 - 1e-9));
  }
  EXPECT_GT(num_bounded, 3);
}

// The point of the ball |e|_p = 1 that is farthest in the direction -y.
Eigen::Vector2d FarthestAgainst(const Eigen::Vector2d& y, double p) {
  if (p == 2) return -y.normalized();
  const Eigen::Vector2d sign(std::copysign(1, y[0]), std::copysign(1, y[1]));
  if (p != 1) return -sign;
  return std::abs(y[0]) > std::abs(y[1]) ? Eigen::Vector2d(-sign[0], 0)
                                         : Eigen::Vector2d(0, -sign[1]);
}

TEST_P(RemainderBoundOf, IsTheBallsOwnInTheDirectionOfThePoint) {
  std::mt19937 random(3);
  constexpr double kMild = 0.02;  // of gamma
  int num_mild = 0;
  for (int i = 0; i < 60; ++i) {
    const RandomCamera camera(GetParam(), &random);
    const double* params = camera.params().data();
    auto trial =
        DrawTrial({GetParam(), params}, LargestAngle(GetParam()), &random);
    if (!trial) continue;
    const Eigen::Vector2d y = 3 * RandomRay(1, &random);
    const auto x_hat = PixelBearing(
        {GetParam(), params},
        trial->pixel + trial->level_px * FarthestAgainst(y, trial->p),
        trial->x_hat);
    if (!x_hat) continue;
    const auto kappa = RemainderBound({GetParam(), params}, trial->pixel,
                                      *x_hat, trial->level_px, trial->p);
    if (!kappa || *kappa > kMild) continue;
    ++num_mild;
    const auto bound = SupportBound({GetParam(), params}, trial->pixel, *x_hat,
                                    y, trial->level_px, trial->p);
    ASSERT_TRUE(bound);
    const double own = trial->level_px * DualNormOf(y, trial->p);
    EXPECT_GE(*bound, (1 - 1e-9) * own);
    EXPECT_LE(*bound, (1 + 1e-5) * own) << "trial " << i << ", p " << trial->p;
  }
  EXPECT_GT(num_mild, 20);
}

// Counts the boxes on which a map is enclosed.
class CountingMap : public ErrorMap {
 public:
  explicit CountingMap(std::unique_ptr<ErrorMap> map) : map_(std::move(map)) {}
  ErrorPair<Interval> Values(const Interval& q1,
                             const Interval& q2) const override {
    return map_->Values(q1, q2);
  }
  ErrorPair<Dual<Interval>> Derivatives(const Interval& q1,
                                        const Interval& q2) const override {
    ++count_;
    return map_->Derivatives(q1, q2);
  }
  int count() const { return count_; }

 private:
  const std::unique_ptr<ErrorMap> map_;
  mutable int count_ = 0;
};

// SIMPLE_RADIAL with k = -0.3 and f = 1000, 697 px from the centre, where the
// ball of 3 px bends by a tenth. The row is taken at the point of the ball in
// the direction (c, s), the pixel's own ray, or anywhere between.
TEST(LargestAlong, NeedsFewBoxesWhereverTheRowIsTaken) {
  const double params[] = {1000, 0, 0, -0.3};
  const Intrinsics intrinsics{2, params};
  const double level = 3;
  const Eigen::Vector2d pixel(697, 0);
  for (const double share : {1.0, 0.5, 0.0}) {
    for (int n = 0; n < 8; ++n) {
      const Eigen::Vector2d along(std::cos(n * kPi / 4), std::sin(n * kPi / 4));
      const Eigen::Vector3d x_hat =
          *PixelBearing(intrinsics, pixel + share * level * along);
      ErrorMap::Geometry geometry;
      geometry.pixel = pixel;
      geometry.E = *RowAtProjection(intrinsics, pixel, x_hat);
      geometry.X0 = PixelBearing(intrinsics, pixel)->normalized();
      const auto chart = *ChartAt(intrinsics, x_hat);
      geometry.X0 /= chart.n.dot(geometry.X0);
      geometry.G = level * chart.B *
                   ChartJacobian(intrinsics, chart, geometry.X0).inverse();
      geometry.on_image_plane = false;
      geometry.level_px = level;
      const CountingMap map(MakeErrorMap(intrinsics, geometry));
      const auto bound = LargestAlong(map, 2, 1.5, -along, 0);
      ASSERT_TRUE(bound);
      EXPECT_LT(map.count(), 300);
      double largest = 0;  // of points of the ball's boundary
      for (int i = 0; i < 10000; ++i) {
        const double angle = i * 2 * kPi / 10000;
        const Eigen::Vector3d ray = *PixelBearing(
            intrinsics,
            pixel + level * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
        const Eigen::Vector3d row = geometry.E * ray;
        largest = std::max(largest, along.dot(row.tail<2>()) / row[0] / level);
      }
      EXPECT_NEAR(*bound, largest, 1e-6);
    }
  }
}

TEST(RemainderBound, OfPinholesIsZero) {
  const double params[] = {500, 600, 320, 240};
  EXPECT_EQ(RemainderBound({1, params}, {10, 20}, {0.1, 0.2, 1}, 3, 2), 0.0);
  EXPECT_FALSE(RemainderBound({1, params}, {10, 20}, {0.1, 0.2, -1}, 3, 2));
}

// SIMPLE_RADIAL with k = -0.3 and f = 1000 folds 702.728 px from the centre.
TEST(RemainderBound, HasNoRegionWhereTheDiscCrossesAFold) {
  const double params[] = {1000, 0, 0, -0.3};
  const auto bound = [&](double radius, double level_px) {
    const Eigen::Vector2d pixel(radius, 0);
    return RemainderBound({2, params}, pixel, *PixelBearing({2, params}, pixel),
                          level_px, 2);
  };
  EXPECT_TRUE(bound(690, 3));
  EXPECT_FALSE(bound(690, 13));
  EXPECT_FALSE(bound(700, 3));
  EXPECT_FALSE(bound(702.72, 1));
  EXPECT_GT(*bound(697, 3), 10 * *bound(600, 3));
}

// On the axis of SIMPLE_RADIAL: f = F u (1 + k r^2) about u = 0, so that
// m = F u, and |f| = gamma at F r (1 + k r^2) = gamma.
TEST(RemainderBound, OnTheAxisIsTheCubicTerm) {
  const double params[] = {100, 0, 0, -0.4};
  double r = 0.08;
  for (int i = 0; i < 50; ++i) r = 0.08 / (1 - 0.4 * r * r);
  const double exact = 100 * r / 8 - 1;
  const auto kappa = RemainderBound({2, params}, {0, 0}, {0, 0, 1}, 8, 2);
  ASSERT_TRUE(kappa);
  EXPECT_GE(*kappa, exact);
  EXPECT_LE(*kappa, 1.11 * exact + 1e-6);
}

TEST(RemainderBound, IsTheSameAtTheSeamOfAPanorama) {
  const double params[] = {3600, 1800};
  const auto bound = [&](double x) {
    const Eigen::Vector2d pixel(x, 500);
    return RemainderBound({17, params}, pixel,
                          *PixelBearing({17, params}, {x + 2, 501}), 4, 2);
  };
  ASSERT_TRUE(bound(1800) && bound(0.5));
  EXPECT_NEAR(*bound(0.5), *bound(1800), 0.05 * *bound(1800));
  EXPECT_FALSE(RemainderBound({17, params}, {1800, 2},
                              *PixelBearing({17, params}, {1800, 5}), 4, 2));
}

TEST(RemainderBound, NamesArgumentsThatAreOutOfRange) {
  const double params[] = {500, 600, 320, 240};
  EXPECT_THROW(RemainderBound({1, params}, {0, 0}, {0, 0, 1}, 0, 2),
               std::invalid_argument);
  EXPECT_THROW(RemainderBound({1, params}, {0, 0}, {0, 0, 1}, 1, 3),
               std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
