#pragma once

#include <filesystem>
#include <vector>

#include "krot/model.h"
#include "krot/model/model_io.h"

namespace krot::internal {

// Whether the bytes begin as an SQLite database does.
inline bool IsDatabase(const FileBytes& file) {
  return file.bytes.rfind("SQLite format 3", 0) == 0;
}

// The pose priors in COLMAP's database (3.8 to 4.x) of images that the model
// has, by name. Latitudes and longitudes (WGS84) are
// taken into the frame of east, north and up at the one that is nearest to the
// median of all, in metres; `options.on_note` is told. Regions are those that a
// Gaussian of the prior's covariance, along the same axes, leaves one time in
// thirty (three standard deviations), options.radius without one, and of radius
// 0 without either. Priors that are not finite are skipped. Throws ModelError
// where there are none, where they are of several coordinate systems, and for
// latitudes beyond a pole.
std::vector<KnownPosition> ReadPosePriors(const std::filesystem::path& path,
                                          const Model& model,
                                          const PositionsOptions& options);

}  // namespace krot::internal
