#pragma once

#include <filesystem>
#include <vector>

#include "krot/model.h"
#include "krot/model/model_io.h"

namespace krot::internal {

// Whether the bytes begin like an SQLite database.
inline bool IsDatabase(const FileBytes& file) {
  return file.bytes.rfind("SQLite format 3", 0) == 0;
}

// Reads the pose priors in COLMAP's database (3.8 to 4.x) for the images of the
// model, which are found by name. Latitudes and longitudes (WGS84) are
// converted to metres east, north and up of one of them, the one nearest to
// their median; `options.on_note` is told. If all priors have an invertible
// covariance, a region is the ellipsoid of three standard deviations, which the
// Gaussian leaves one time in thirty. Otherwise all regions are balls of
// options.radius, or of radius 0 without that. Priors that are not finite are
// skipped. Throws ModelError if there are no priors, if they use several
// coordinate systems, and for latitudes beyond a pole.
std::vector<KnownPosition> ReadPosePriors(const std::filesystem::path& path,
                                          const Model& model,
                                          const PositionsOptions& options);

}  // namespace krot::internal
