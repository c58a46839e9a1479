#include "krot/analysis/epipolar.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <iostream>
#include <random>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

using Random = std::mt19937;

double Uniform(double low, double high, Random* random) {
  return low + (high - low) * (static_cast<double>((*random)()) / 4294967296.0);
}

constexpr double kFocalLength = 1000;

// The ray of a pixel of a camera with this focal length, in world axes.
PixelRay RayAt(const Eigen::Vector2d& pixel) {
  PixelRay ray;
  ray.ray = (pixel / kFocalLength).homogeneous();
  ray.by_pixel << 1 / kFocalLength, 0, 0, 1 / kFocalLength, 0, 0;
  return ray;
}

Eigen::Vector2d RandomPixel(Random* random) {
  return {Uniform(-500, 500, random), Uniform(-400, 400, random)};
}

// Two cameras that look along z, `baseline` apart; the first `num_right`
// matches see points, with noise, the others are arbitrary.
std::vector<EpipolarMatch> RandomMatches(int count, int num_right,
                                         const Eigen::Vector3d& baseline,
                                         double noise_px, Random* random) {
  std::vector<EpipolarMatch> matches;
  for (int k = 0; k < count; ++k) {
    const Eigen::Vector2d pixel1 = RandomPixel(random);
    Eigen::Vector2d pixel2 = RandomPixel(random);
    if (k < num_right) {
      const Eigen::Vector3d point =
          Uniform(4, 12, random) * RayAt(pixel1).ray - baseline;
      pixel2 = kFocalLength * point.hnormalized() +
               Eigen::Vector2d(Uniform(-noise_px, noise_px, random),
                               Uniform(-noise_px, noise_px, random));
    }
    matches.emplace_back(RayAt(pixel1), RayAt(pixel2));
  }
  return matches;
}

int64_t NumExplained(const std::vector<EpipolarMatch>& matches,
                     const Eigen::Vector3d& baseline, double tolerance_px) {
  return std::count_if(matches.begin(), matches.end(),
                       [&](const EpipolarMatch& match) {
                         return match.ErrorPx(baseline) <= tolerance_px;
                       });
}

// The most matches of any direction on a fine grid of the whole cube, and of
// the directions that explain two matches exactly.
int64_t BruteForce(const std::vector<EpipolarMatch>& matches,
                   double tolerance_px) {
  constexpr int kSteps = 150;
  int64_t most = 0;
  const auto look = [&](const Eigen::Vector3d& baseline) {
    if (baseline.isZero()) return;
    most = std::max(most, NumExplained(matches, baseline, tolerance_px));
  };
  for (int x = -kSteps; x <= kSteps; ++x) {
    for (int y = -kSteps; y <= kSteps; ++y) {
      look(Eigen::Vector3d(kSteps, x, y));
      look(Eigen::Vector3d(x, kSteps, y));
      look(Eigen::Vector3d(x, y, kSteps));
    }
  }
  for (const EpipolarMatch& a : matches) {
    for (const EpipolarMatch& b : matches) look(a.normal.cross(b.normal));
  }
  return most;
}

TEST(EpipolarMatch, ErrorIsHowFarThePixelsMustMoveTogether) {
  Random random(1);
  const Eigen::Vector3d baseline(1, 0.2, -0.1);
  const Eigen::Vector2d pixel1 = RandomPixel(&random);
  const Eigen::Vector3d point = 6 * RayAt(pixel1).ray - baseline;
  const Eigen::Vector2d pixel2 = kFocalLength * point.hnormalized();
  EXPECT_LT(EpipolarMatch(RayAt(pixel1), RayAt(pixel2)).ErrorPx(baseline),
            1e-10);
  // Of shifts of length 1 of all four coordinates the worst costs 1 px.
  double largest = 0;
  for (int k = 0; k < 5000; ++k) {
    Eigen::Vector4d shift;
    for (int i = 0; i < 4; ++i) shift[i] = Uniform(-1, 1, &random);
    shift *= 0.01 / shift.norm();
    const EpipolarMatch match(RayAt(pixel1 + shift.head<2>()),
                              RayAt(pixel2 + shift.tail<2>()));
    const double error = match.ErrorPx(baseline);
    EXPECT_NEAR(match.ErrorPx(-7 * baseline), error, 1e-9);
    largest = std::max(largest, error);
  }
  EXPECT_NEAR(largest, 0.01, 5e-4);
}

// As of a video whose camera stands still for most of the time.
TEST(EstimateMatchNoise, IsNotThatOfPhotosFromOnePlace) {
  std::mt19937 random(8);
  std::normal_distribution<double> gauss;
  std::vector<std::vector<double>> errors;
  std::vector<double> parallaxes;
  for (int pair = 0; pair < 100; ++pair) {
    const bool is_still = pair < 70;
    std::vector<double>& list = errors.emplace_back();
    for (int k = 0; k < 200; ++k) {
      list.push_back(std::abs((is_still ? 0.02 : 0.5) * gauss(random)));
    }
    std::sort(list.begin(), list.end());
    parallaxes.push_back(is_still ? 0.04 : 20);
  }
  EXPECT_NEAR(EstimateMatchNoise(errors, parallaxes).sigma_px, 0.5, 0.02);
  errors.resize(70);
  EXPECT_NEAR(EstimateMatchNoise(errors, parallaxes).sigma_px, 0.02, 0.001);
}

TEST(SearchBaseline, FindsNoFewerThanBruteForceAndProvesIt) {
  Random random(2);
  for (int trial = 0; trial < 40; ++trial) {
    const int count = 2 + trial % 11;
    const double tolerance_px = trial % 3 == 0 ? 1 : 15 * (trial % 3);
    const auto matches = RandomMatches(count, trial % (count + 1),
                                       {1, 0.1 * trial, 0.3}, 5, &random);
    const BaselineSearch search = SearchBaseline(matches, tolerance_px);
    EXPECT_EQ(search.upper_bound, search.num_explained);
    EXPECT_GE(search.num_explained, BruteForce(matches, tolerance_px));
    // Rounding may take what lies on the border.
    EXPECT_GE(NumExplained(matches, search.baseline, tolerance_px * (1 + 1e-9)),
              search.num_explained);
  }
}

// Prints the median of their processor times.
TEST(SearchBaseline, FindsTheBaselineOfHalfOfAThousandMatches) {
  Random random(3);
  std::vector<double> milliseconds;
  for (int trial = 0; trial < 21; ++trial) {
    // Sideways, forward, hardly at all.
    const std::vector<Eigen::Vector3d> baselines = {
        {0.8, -0.3, 0.4}, {0.02, 0.01, 1}, {0.003, 0, 0}};
    const Eigen::Vector3d& baseline = baselines[trial % 3];
    const auto matches = RandomMatches(1000, 500, baseline, 1, &random);
    const std::clock_t begin = std::clock();
    const BaselineSearch search = SearchBaseline(matches, 2);
    milliseconds.push_back(1e3 * static_cast<double>(std::clock() - begin) /
                           CLOCKS_PER_SEC);
    EXPECT_EQ(search.upper_bound, search.num_explained);
    EXPECT_GE(search.num_explained, NumExplained(matches, baseline, 2));
    EXPECT_GE(search.num_explained, 500);
    EXPECT_LT(search.num_explained, 560);
    EXPECT_LT(search.num_cells, 50000);
    if (trial % 3 == 2) continue;
    EXPECT_GT(std::abs(search.baseline.dot(baseline.normalized())), 0.999);
  }
  std::sort(milliseconds.begin(), milliseconds.end());
  std::cout << "1,000 matches, half of them wrong: median "
            << milliseconds[milliseconds.size() / 2] << " ms, largest "
            << milliseconds.back() << " ms\n";
}

TEST(SearchBaseline, ThatEndsEarlyStillBoundsWhatAnyBaselineExplains) {
  Random random(4);
  const auto matches = RandomMatches(100, 60, {0, 0, 1}, 1, &random);
  const int64_t most = SearchBaseline(matches, 2).num_explained;
  for (const int64_t max_cells : {1, 10, 100}) {
    const BaselineSearch search = SearchBaseline(matches, 2, max_cells);
    EXPECT_LE(search.num_explained, most);
    EXPECT_GE(search.upper_bound, most);
  }
}

TEST(SearchBaseline, OfNoMatchesExplainsNone) {
  EXPECT_EQ(SearchBaseline({}, 1).upper_bound, 0);
}

}  // namespace
}  // namespace krot::internal
