// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#include "colmap/estimators/known_rotation.h"

#include "colmap/estimators/global_positioning.h"
#include "colmap/math/random.h"
#include "colmap/scene/pose_graph.h"
#include "colmap/scene/reconstruction.h"
#include "colmap/scene/synthetic.h"
#include "colmap/util/logging.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace colmap {
namespace {

// Of all observations, pixels.
double LargestError(const Reconstruction& reconstruction) {
  double largest = 0;
  for (const auto& [id, point] : reconstruction.Points3D()) {
    for (const TrackElement& element : point.track.Elements()) {
      const Image& image = reconstruction.Image(element.image_id);
      const auto pixel = image.ProjectPoint(point.xyz);
      if (!pixel) return std::numeric_limits<double>::infinity();
      largest = std::max(
          largest, (*pixel - image.Point2D(element.point2D_idx).xy).norm());
    }
  }
  return largest;
}

// Two cameras to a frame, noisy pixels, and poses and points a little off.
Reconstruction MakeNoisyReconstruction() {
  SetPRNGSeed(1);
  Reconstruction reconstruction;
  SyntheticDatasetOptions options;
  options.num_rigs = 1;
  options.num_cameras_per_rig = 2;
  options.num_frames_per_rig = 6;
  options.num_points3D = 100;
  options.camera_has_prior_focal_length = true;
  SynthesizeDataset(options, &reconstruction);
  SyntheticNoiseOptions noise;
  noise.point2D_stddev = 0.5;
  noise.point3D_stddev = 0.01;
  noise.rig_from_world_translation_stddev = 0.01;
  SynthesizeNoise(noise, &reconstruction);
  return reconstruction;
}

TEST(KnownRotation, LowersTheLargestErrorAndKeepsRotations) {
  const Reconstruction before = MakeNoisyReconstruction();
  Reconstruction after = before;
  ASSERT_TRUE(SolveKnownRotation({}, after));
  EXPECT_LT(LargestError(after), LargestError(before));
  for (const frame_t id : before.RegFrameIds()) {
    EXPECT_EQ(before.Frame(id).RigFromWorld().rotation().coeffs(),
              after.Frame(id).RigFromWorld().rotation().coeffs());
  }
}

TEST(KnownRotation, FindsPositionsFromRotationsAndTracksAlone) {
  const Reconstruction truth = MakeNoisyReconstruction();
  Reconstruction from_model = truth;
  ASSERT_TRUE(SolveKnownRotation({}, from_model));
  Reconstruction from_nothing = truth;
  for (const auto& [id, point] : truth.Points3D()) {
    from_nothing.Point3D(id).xyz.setZero();
  }
  KnownRotationOptions options;
  options.init = KnownRotationInit::FEASIBLE;
  ASSERT_TRUE(SolveKnownRotation(options, from_nothing));
  // Noise explains all observations, and the least squares are above the lowest
  // maximum, to which from_model is within gap and finish.
  const double num_observations = truth.ComputeNumObservations();
  EXPECT_EQ(from_nothing.ComputeNumObservations(), num_observations);
  EXPECT_GT(LargestError(from_nothing), (1 - 1e-3) * LargestError(from_model));
  // Exceeded in one of twenty reconstructions with this noise [Bonferroni].
  EXPECT_LT(LargestError(from_nothing),
            0.5 * std::sqrt(2 * std::log(20 * num_observations)));
}

TEST(KnownRotation, WarnsOfPositionsThatAreNotToBeReliedOn) {
  Reconstruction reconstruction = MakeNoisyReconstruction();
  for (const auto& [id, image] : reconstruction.Images()) {
    for (Point2D& point2D : reconstruction.Image(id).Points2D()) {
      point2D.xy = Eigen::Vector2d(RandomUniformReal<double>(0, 1000),
                                   RandomUniformReal<double>(0, 1000));
    }
  }
  for (const auto& [id, point] : reconstruction.Points3D()) {
    reconstruction.Point3D(id).xyz.setZero();
  }
  KnownRotationOptions options;
  options.init = KnownRotationInit::FEASIBLE;
  FLAGS_logtostderr = true;
  testing::internal::CaptureStderr();
  EXPECT_TRUE(SolveKnownRotation(options, reconstruction));
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              testing::HasSubstr("not to be relied on"));
}

TEST(KnownRotation, RefusesOptionsOutOfRange) {
  KnownRotationOptions options;
  options.max_error = -3;
  EXPECT_FALSE(options.Check());
  options.max_error = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(options.Check());
  options.max_error = 0;
  EXPECT_TRUE(options.Check());
  options.relative_gap = 0;
  EXPECT_FALSE(options.Check());
  options.relative_gap = 1e-3;
  options.num_threads = 0;
  EXPECT_FALSE(options.Check());
}

TEST(KnownRotation, LeavesTheReconstructionAloneWhenStopped) {
  const Reconstruction before = MakeNoisyReconstruction();
  Reconstruction after = before;
  KnownRotationOptions options;
  options.relative_gap = 1e-12;
  bool is_asked = false;
  options.check_if_stopped = [&is_asked]() { return is_asked = true; };
  const bool success = SolveKnownRotation(options, after);
  EXPECT_NE(success, is_asked);  // It may end before it is asked.
  if (!success) {
    EXPECT_EQ(LargestError(after), LargestError(before));
  }
}

// Plants an observation that is 100 pixels off, and returns it.
TrackElement PlantOutlier(Reconstruction& reconstruction) {
  const point3D_t id = *reconstruction.Point3DIds().begin();
  const TrackElement planted = reconstruction.Point3D(id).track.Element(0);
  reconstruction.Image(planted.image_id).Point2D(planted.point2D_idx).xy.x() +=
      100;
  return planted;
}

bool HasPoint3D(const Reconstruction& reconstruction,
                const TrackElement& element) {
  return reconstruction.Image(element.image_id)
      .Point2D(element.point2D_idx)
      .HasPoint3D();
}

TEST(OutlierFilter, RemovesThePlantedObservationWithAndWithoutAProof) {
  for (const bool prove : {true, false}) {
    Reconstruction reconstruction = MakeNoisyReconstruction();
    const TrackElement planted = PlantOutlier(reconstruction);
    OutlierFilterOptions options;
    options.max_error = 5;
    options.prove = prove;
    ASSERT_TRUE(FilterOutliers(options, reconstruction));
    EXPECT_FALSE(HasPoint3D(reconstruction, planted));
    EXPECT_LE(LargestError(reconstruction), options.max_error);
  }
}

TEST(ModelChecker, RemovesThePlantedObservation) {
  Reconstruction reconstruction = MakeNoisyReconstruction();
  ASSERT_TRUE(SolveKnownRotation({}, reconstruction));
  const TrackElement planted = PlantOutlier(reconstruction);
  const ModelCheckerSummary summary = CheckReconstruction({}, reconstruction);
  EXPECT_TRUE(summary.is_checked);
  EXPECT_GE(summary.num_wrong_observations, 1);
  EXPECT_EQ(summary.num_wrong_images, 0);
  EXPECT_FALSE(HasPoint3D(reconstruction, planted));
}

// Positions and points are what is to be found, so they are taken away.
Reconstruction WithoutPositions(Reconstruction reconstruction) {
  for (const frame_t id : reconstruction.RegFrameIds()) {
    reconstruction.Frame(id).RigFromWorld().translation().setZero();
  }
  for (const point3D_t id : reconstruction.Point3DIds()) {
    reconstruction.Point3D(id).xyz.setZero();
  }
  return reconstruction;
}

TEST(GlobalPositioning, WithKrotFindsPositionsWithoutTheOutlier) {
  Reconstruction planted = MakeNoisyReconstruction();
  const TrackElement outlier = PlantOutlier(planted);
  GlobalPositionerOptions options;
  options.backend = GlobalPositionerBackend::KROT;
  options.krot_max_error = 5;
  Reconstruction first = WithoutPositions(planted);
  ASSERT_TRUE(RunGlobalPositioning(options, PoseGraph(), first));
  EXPECT_LE(LargestError(first), options.krot_max_error);
  EXPECT_FALSE(HasPoint3D(first, outlier));

  Reconstruction second = WithoutPositions(planted);
  ASSERT_TRUE(RunGlobalPositioning(options, PoseGraph(), second));
  for (const frame_t id : first.RegFrameIds()) {
    EXPECT_EQ(first.Frame(id).RigFromWorld().translation(),
              second.Frame(id).RigFromWorld().translation());
  }
}

TEST(GlobalPositioning, WithKrotRefusesWhatItDoesNotServe) {
  const Reconstruction served = WithoutPositions(MakeNoisyReconstruction());
  GlobalPositionerOptions options;
  options.backend = GlobalPositionerBackend::KROT;
  const auto is_refused = [&options](Reconstruction reconstruction) {
    return !RunGlobalPositioning(options, PoseGraph(), reconstruction);
  };
  ASSERT_FALSE(is_refused(served));

  Reconstruction without_focal_length = served;
  without_focal_length.Camera(served.Cameras().begin()->first)
      .has_prior_focal_length = false;
  EXPECT_TRUE(is_refused(without_focal_length));

  Reconstruction without_rig = served;
  Rig& rig = without_rig.Rig(served.Rigs().begin()->first);
  const sensor_t sensor = rig.NonRefSensors().begin()->first;
  rig.SensorFromRig(sensor).translation().setConstant(
      std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(is_refused(without_rig));

  options.krot_max_error = -3;
  EXPECT_TRUE(is_refused(served));
  options.krot_max_error = 0;
  options.optimize_points = false;
  EXPECT_TRUE(is_refused(served));
}

}  // namespace
}  // namespace colmap
