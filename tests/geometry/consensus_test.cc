#include "krot/geometry/transform.h"

#include <numeric>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot::internal {
namespace {

using Eigen::Vector3d;
using ::testing::Each;

constexpr double kScale = 3;
const Vector3d kShift(10, -20, 5);

// Cameras on a circle of radius 5 that see points 5 away; `noise` is added to
// where the second model has them, and then it is scaled and shifted.
std::vector<CameraMove> Circle(int count, double noise) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<CameraMove> cameras;
  for (int n = 0; n < count; ++n) {
    const double angle = 2 * M_PI * n / count;
    const Vector3d at(5 * std::cos(angle), 5 * std::sin(angle), 1);
    const Vector3d moved =
        at + noise * Vector3d(normal(random), normal(random), normal(random));
    cameras.push_back({at, kScale * moved + kShift, 5, 5 * kScale});
  }
  return cameras;
}

int NumKept(const std::vector<CameraMove>& cameras, bool scale_is_free = true) {
  const std::vector<char> keeps = FindConsensus(cameras, scale_is_free);
  return std::accumulate(keeps.begin(), keeps.end(), 0);
}

TEST(FindConsensus, IsOfAllWhereTheyMoveTogether) {
  EXPECT_EQ(NumKept(Circle(12, 0)), 12);
  EXPECT_EQ(NumKept(Circle(12, 0.05)), 12);
}

TEST(FindConsensus, IsOfAllWhereAllAreMovedALot) {
  EXPECT_EQ(NumKept(Circle(12, 1)), 12);
  EXPECT_EQ(NumKept(Circle(12, 20)), 12);
}

TEST(FindConsensus, IsWithoutRunawaysHoweverFarTheyRun) {
  for (const double far : {30.0, 1e4, 1e9}) {
    SCOPED_TRACE(far);
    // From among the others, back to them, and along the line on which it
    // already was far away: nearly the common scale, to least squares.
    for (const auto& [from, to] :
         {std::pair{1.0, far}, {far, 1.0}, {far, 1e3 * far}}) {
      std::vector<CameraMove> cameras = Circle(12, 0.01);
      const Vector3d direction = Vector3d(3, 4, 1).normalized();
      cameras[5] = {from * direction, kScale * to * direction + kShift, from,
                    kScale * to};
      std::vector<char> expected(12, 1);
      expected[5] = 0;
      EXPECT_EQ(FindConsensus(cameras, true), expected);
    }
  }
}

TEST(FindConsensus, KnowsRunawaysThatSeeWhatIsFarAwayByTheOthersSpread) {
  std::vector<CameraMove> cameras = Circle(12, 0.01);
  for (CameraMove& camera : cameras) {
    camera.distance_before = 900;
    camera.distance_after = kScale * 900;
  }
  cameras[5].after += kScale * Vector3d(20, 0, 0);
  std::vector<char> expected(12, 1);
  expected[5] = 0;
  EXPECT_EQ(FindConsensus(cameras, true), expected);
}

TEST(FindConsensus, StandsUpToAlmostAsManyRunaways) {
  std::vector<CameraMove> cameras = Circle(12, 0.01);
  for (int n = 0; n < 5; ++n) {
    cameras[n].after = Vector3d(100 * n, 1e5, -1e4 * n);
    cameras[n].distance_after = 1e5;
  }
  EXPECT_EQ(NumKept(cameras), 7);
}

TEST(FindConsensus, KnowsAFixedScale) {
  std::vector<CameraMove> cameras = Circle(12, 0);
  for (CameraMove& camera : cameras) {
    camera.after = camera.before + kShift;
    camera.distance_after = 7;  // points may be farther away, cameras are not
  }
  cameras[2].after *= 50;
  EXPECT_EQ(NumKept(cameras, /*scale_is_free=*/false), 11);
}

TEST(FindConsensus, KeepsCamerasApartFromATightCluster) {
  // On a tripod, a hair's breadth apart and not to be told from each other; and
  // a few elsewhere.
  std::vector<CameraMove> cameras = Circle(5, 0.01);
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 20; ++n) {
    const auto wobble = [&]() -> Vector3d {
      return 1e-3 * Vector3d(normal(random), normal(random), normal(random));
    };
    cameras.push_back(
        {wobble(), kScale * wobble() + kShift, 5, 5 * kScale * 1.1});
  }
  EXPECT_EQ(NumKept(cameras), 25);
}

TEST(FindConsensus, IsOfAllWhereNothingIsKnown) {
  std::vector<CameraMove> two = Circle(2, 0);
  two[1].after *= 1e6;
  EXPECT_THAT(FindConsensus(two, true), Each(1));
  std::vector<CameraMove> without_points = Circle(12, 0);
  without_points[3].after *= 1e6;
  for (CameraMove& camera : without_points) camera.distance_after = 0;
  EXPECT_THAT(FindConsensus(without_points, true), Each(1));
  EXPECT_TRUE(FindConsensus({}, true).empty());
}

}  // namespace
}  // namespace krot::internal
