#pragma once

#include <cstdint>
#include <filesystem>

#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/synthetic/scene.h"

namespace krot::internal {

// Models for the tests of the command line.

// A few hundred observations, noisy, off their optimum.
SceneOptions SmallScene();

// SmallScene with so many cameras on its rig; one: without rigs and frames.
Model SmallRigModel(int sensors_per_rig);

// SmallScene without rigs and frames.
Model SmallLegacyModel();

void Save(const Model& model, const std::filesystem::path& folder,
          ModelFormat format = ModelFormat::kBinary);
Model Load(const std::filesystem::path& folder);

// With all centres and points moved by Gaussian noise; sigma per axis is
// `share` of the scene: of the median distance of the points from the centroid
// of the cameras.
Model Perturbed(const Model& model, double share, uint64_t seed);

// Without what a solver estimates: NaN instead of every translation of frames
// and images.
Model WithoutTranslations(const Model& model);

// With the first `length` observations of every track only; 0: no points.
Model WithShortTracks(const Model& model, uint64_t length);

// 100 times as large and `shift` away, as in UTM or ECEF coordinates.
Model FarAway(const Model& model, const Eigen::Vector3d& shift);

}  // namespace krot::internal
