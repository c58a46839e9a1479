// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#include "colmap/estimators/known_rotation.h"

#include "colmap/math/random.h"
#include "colmap/scene/reconstruction.h"
#include "colmap/scene/synthetic.h"

#include <algorithm>
#include <limits>

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
  options.init = "feasible";
  ASSERT_TRUE(SolveKnownRotation(options, from_nothing));
  EXPECT_NEAR(LargestError(from_nothing), LargestError(from_model), 1e-2);
}

TEST(OutlierFilter, RemovesThePlantedObservation) {
  Reconstruction reconstruction = MakeNoisyReconstruction();
  const point3D_t id = *reconstruction.Point3DIds().begin();
  const TrackElement planted =
      reconstruction.Point3D(id).track.Element(0);
  reconstruction.Image(planted.image_id).Point2D(planted.point2D_idx).xy.x() +=
      100;
  OutlierFilterOptions options;
  options.max_error = 5;
  ASSERT_TRUE(FilterOutliers(options, reconstruction));
  EXPECT_FALSE(reconstruction.Image(planted.image_id)
                   .Point2D(planted.point2D_idx)
                   .HasPoint3D());
  EXPECT_LE(LargestError(reconstruction), options.max_error);
}

TEST(KnownRotation, RefusesWhatIsNoStart) {
  KnownRotationOptions options;
  options.init = "random";
  EXPECT_FALSE(options.Check());
}

}  // namespace
}  // namespace colmap
