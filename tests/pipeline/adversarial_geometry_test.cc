#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/pipeline/solve_model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

// Scenes in which something that solvers like to take for granted is missing:
// parallax, a baseline, noise, more than one point in common. The truth itself
// judges: no bound may be above its largest error, and what is solved to the
// gap is not above it either.

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kFocal = 1000;  // pixels
constexpr int kWidth = 1200;
constexpr double kLargestGap = 1e-3;

struct Geometry {
  std::vector<Vector3d> centres;
  std::vector<Vector3d> points;
  double pixel_noise = 0.5;
  double yaw_step_deg = 0;  // from image to image
  std::function<bool(int image, int point)> is_seen = {};  // all, if empty
};

struct Truth {
  Model start;
  double max_error = 0;  // of the true poses and points, pixels
};

// An image per centre, looking along +z before its yaw, of what it has in view.
Truth MakeTruth(const Geometry& geometry) {
  Random random(1);
  Model model;
  model.cameras = {
      {1, 1, kWidth, kWidth, {kFocal, kFocal, kWidth / 2, kWidth / 2}}};
  const int num_points = static_cast<int>(geometry.points.size());
  std::vector<std::vector<TrackElement>> tracks(num_points);
  std::vector<double> nearest(num_points, HUGE_VAL);
  for (int i = 0; i < static_cast<int>(geometry.centres.size()); ++i) {
    const double yaw = i * geometry.yaw_step_deg * M_PI / 180;
    const Matrix3d R =
        Eigen::AngleAxisd(yaw, Vector3d::UnitY()).toRotationMatrix();
    Image image;
    image.id = static_cast<ImageId>(i + 1);
    image.camera_id = 1;
    image.name = std::to_string(i);
    image.cam_from_world = ToPose({R, -R * geometry.centres[i]});
    for (int k = 0; k < num_points; ++k) {
      const Vector3d x = R * (geometry.points[k] - geometry.centres[i]);
      const Eigen::Vector2d noise =
          geometry.pixel_noise * random.GaussianVector().head<2>();
      const Eigen::Vector2d pixel = kFocal * x.hnormalized() + noise +
                                    Eigen::Vector2d::Constant(kWidth / 2);
      if (x.z() <= 0 || pixel.minCoeff() < 0 || pixel.maxCoeff() > kWidth ||
          (geometry.is_seen && !geometry.is_seen(i, k))) {
        continue;
      }
      nearest[k] = std::min(nearest[k], x.norm());
      tracks[k].push_back(
          {image.id, static_cast<uint32_t>(image.points2D.size())});
      image.points2D.push_back(
          {pixel.x(), pixel.y(), static_cast<Point3DId>(k + 1)});
    }
    model.images.push_back(image);
  }
  for (int k = 0; k < num_points; ++k) {
    Point3D point;
    point.id = k + 1;
    point.xyz = geometry.points[k];
    point.track_begin = model.track_elements.size();
    model.track_elements.insert(model.track_elements.end(), tracks[k].begin(),
                                tracks[k].end());
    point.track_end = model.track_elements.size();
    model.points3D.push_back(point);
  }
  UseTrivialRigs(&model);
  Truth truth;
  truth.max_error = Summarize(PixelErrors(model)).max;
  for (int k = 0; k < num_points; ++k) {
    if (tracks[k].empty()) continue;
    model.points3D[k].xyz += 1e-3 * nearest[k] * random.GaussianVector();
  }
  truth.start = model;
  return truth;
}

// What must hold however hard the scene is.
SolveSummary ExpectTruthful(const Truth& truth) {
  SolveModelOptions options;
  options.joint.relative_gap = kLargestGap;
  const SolveModelResult result = SolveModel(truth.start, options);
  ValidateModel(result.model);
  const SolveSummary& summary = result.summary;
  EXPECT_LE(summary.pixel_error_after.max, summary.pixel_error_before.max);
  if (summary.is_certified) {
    EXPECT_LE(*summary.lower_bound, truth.max_error);
  }
  return summary;
}

void ExpectSolved(const Truth& truth) {
  const SolveSummary summary = ExpectTruthful(truth);
  if (summary.termination != SolveTermination::kZeroCost) {
    EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
    EXPECT_TRUE(summary.is_certified);
  }
  EXPECT_LE(summary.LowestCost(), truth.max_error / (1 - kLargestGap) + 1e-6);
}

// In a box in front of the cameras.
std::vector<Vector3d> PointsAt(double distance, int count, double width = 0.8) {
  Random random(2);
  std::vector<Vector3d> points;
  for (int k = 0; k < count; ++k) {
    points.push_back(distance * Vector3d(random.Uniform(-width, width) / 2,
                                         random.Uniform(-width, width) / 2,
                                         random.Uniform(0.8, 1.2)));
  }
  return points;
}

std::vector<Vector3d> CentresIn(double radius, int count) {
  Random random(3);
  std::vector<Vector3d> centres;
  for (int i = 0; i < count; ++i) {
    centres.push_back(radius * Vector3d(random.Uniform(-1, 1),
                                        random.Uniform(-1, 1),
                                        random.Uniform(-1, 1)));
  }
  return centres;
}

void Append(const std::vector<Vector3d>& more, std::vector<Vector3d>* all) {
  all->insert(all->end(), more.begin(), more.end());
}

TEST(AdversarialGeometry, PointsAtInfinity) {
  for (const double distance : {1e6, 1e9, 1e12}) {
    SCOPED_TRACE(distance);
    Geometry geometry{CentresIn(1, 6), PointsAt(8, 40)};
    Append(PointsAt(distance, 40), &geometry.points);
    ExpectSolved(MakeTruth(geometry));
  }
}

TEST(AdversarialGeometry, PureForwardMotion) {
  Geometry geometry{{}, PointsAt(20, 80)};
  for (int i = 0; i < 8; ++i) geometry.centres.push_back({0, 0, 0.5 * i});
  geometry.points.push_back({0, 0, 15});  // on the way
  ExpectSolved(MakeTruth(geometry));
}

TEST(AdversarialGeometry, CollinearCentres) {
  Geometry geometry{{}, PointsAt(8, 60)};
  for (int i = 0; i < 8; ++i) geometry.centres.push_back({0.3 * i, 0, 0});
  for (int i = 0; i < 60; i += 10) {
    geometry.points.push_back({8.0 + i, 0, 0.3});  // near the line itself
  }
  ExpectSolved(MakeTruth(geometry));
}

TEST(AdversarialGeometry, PanoramaFromOnePlace) {
  Geometry geometry{CentresIn(0, 6), PointsAt(8, 200, 2)};
  geometry.yaw_step_deg = 5;
  ExpectSolved(MakeTruth(geometry));
}

TEST(AdversarialGeometry, SomeCamerasInOnePlace) {
  Geometry geometry{CentresIn(1, 4), PointsAt(8, 60)};
  Append(geometry.centres, &geometry.centres);
  geometry.yaw_step_deg = 2;
  ExpectSolved(MakeTruth(geometry));
}

TEST(AdversarialGeometry, BaselinesOfOnePixelOfParallax) {
  for (const double pixels : {1.0, 0.01}) {
    SCOPED_TRACE(pixels);
    ExpectSolved(
        MakeTruth({CentresIn(pixels * 8 / kFocal, 6), PointsAt(8, 60)}));
  }
}

TEST(AdversarialGeometry, PerfectData) {
  Geometry geometry{CentresIn(1, 6), PointsAt(8, 60)};
  geometry.pixel_noise = 0;
  ExpectSolved(MakeTruth(geometry));
}

TEST(AdversarialGeometry, APointInEveryImageOfMany) {
  Geometry geometry{{}, {}};
  constexpr int kImages = 400;
  for (int i = 0; i < kImages; ++i) {
    geometry.centres.push_back({0.1 * std::sin(i), 0.1 * i, 0});
  }
  geometry.points = {{0, kImages / 20.0, 500}};  // before all
  for (int k = 0; k < 3 * kImages; ++k) {
    geometry.points.push_back({std::sin(7 * k), k / 30.0, 8 + std::cos(k)});
  }
  geometry.is_seen = [](int i, int k) {
    return k == 0 || std::abs(k / 30.0 - 0.1 * i) < 0.5;
  };
  ExpectSolved(MakeTruth(geometry));
}

TEST(AdversarialGeometry, AnImageWithManyPoints) {
  ExpectSolved(MakeTruth({CentresIn(1, 3), PointsAt(8, 20000)}));
}

TEST(AdversarialGeometry, PartsJoinedByOnePoint) {
  Geometry geometry{CentresIn(1, 4), {{0, 0, 20}}};
  for (const Vector3d& centre : CentresIn(1, 4)) {
    geometry.centres.push_back(centre + Vector3d(3, 0, 0));
  }
  Append(PointsAt(8, 80), &geometry.points);
  geometry.is_seen = [](int i, int k) { return k == 0 || (i < 4) == (k < 41); };
  ExpectSolved(MakeTruth(geometry));
}

Truth RigsOfBaseline(double baseline) {
  SceneOptions options = SceneOf(6, 100, 6, 0.5);
  options.sensors_per_rig = 3;
  options.rig_baseline = baseline;
  options.start_translation_noise = 1e-3;
  options.start_point_noise = 1e-3;
  const SyntheticScene scene = SynthesizeScene(options);
  return {scene.model, Summarize(PixelErrors(scene.ground_truth)).max};
}

TEST(AdversarialGeometry, RigsOfTinyAndHugeBaselines) {
  for (const double baseline : {1e-6, 1e-4, 0.2}) {
    SCOPED_TRACE(baseline);
    ExpectSolved(RigsOfBaseline(baseline));
  }
  // Of the viewing distance, less than multipliers resolve.
  ExpectTruthful(RigsOfBaseline(1e-9));
}

}  // namespace
}  // namespace krot::internal
