#include "krot/model/model_io.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include <Eigen/Eigenvalues>

#include "krot/base/numbers.h"
#include "krot/geometry/transform.h"
#include "krot/model/rigs.h"
#include "krot/model/sqlite_rows.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

struct PosePrior {
  int32_t image = 0;
  Vector3d position;
  std::optional<Matrix3d> covariance;
  bool is_geodetic = false;
};

// The matrix in the blob; none unless it holds exactly that many finite
// doubles.
template <typename Matrix>
std::optional<Matrix> MatrixOf(std::string_view blob) {
  Matrix matrix;
  if (blob.size() != sizeof(double) * matrix.size()) return std::nullopt;
  std::memcpy(matrix.data(), blob.data(), blob.size());
  if (!matrix.allFinite()) return std::nullopt;
  return matrix;
}

std::vector<PosePrior> ReadRows(SqliteDatabase* database, const Model& model) {
  const auto image_of_name = ImagesByName(model);
  std::unordered_map<int64_t, int32_t> image_of_id;
  SqliteRows images(database, "images", "image_id, name");
  while (images.Next()) {
    const auto found = image_of_name.find(images.Text(1));
    if (found == image_of_name.end()) continue;
    image_of_id.emplace(images.Integer(0), found->second);
  }
  // The table differs between versions. COLMAP 4 stores the sensor, too;
  // earlier versions only the image; 3.10 has no covariance. Before that, the
  // latitude, longitude and height of EXIF were in the prior_t of the images.
  std::optional<SqliteRows> rows;
  int form = 0;
  for (const auto& [table, columns] :
       {std::make_pair("pose_priors",
                       "corr_data_id, position, coordinate_system, "
                       "position_covariance, corr_sensor_type"),
        std::make_pair(
            "pose_priors",
            "image_id, position, coordinate_system, position_covariance"),
        std::make_pair("pose_priors", "image_id, position, coordinate_system"),
        std::make_pair("images", "image_id, prior_tx, prior_ty, prior_tz")}) {
    try {
      rows.emplace(database, table, columns);
      break;
    } catch (const ModelError&) {
      if (form++ == 3) throw;
    }
  }
  const bool is_oldest = form == 3;
  std::vector<PosePrior> priors;
  while (rows->Next()) {
    if (form == 0 && rows->Integer(4) != kSensorTypeCamera) continue;
    const auto image = image_of_id.find(rows->Integer(0));
    if (image == image_of_id.end()) continue;
    PosePrior prior{image->second, Vector3d::Constant(kNaN), std::nullopt,
                    is_oldest};
    if (is_oldest) {
      for (int c = 0; c < 3; ++c) prior.position[c] = rows->Real(c + 1);
    } else {
      const auto position = MatrixOf<Vector3d>(rows->Blob(1));
      if (position) prior.position = *position;
      prior.is_geodetic = rows->Integer(2) == 0;  // WGS84
      if (form < 2) prior.covariance = MatrixOf<Matrix3d>(rows->Blob(3));
    }
    if (prior.position.allFinite()) priors.push_back(std::move(prior));
  }
  std::sort(priors.begin(), priors.end(),
            [](const auto& a, const auto& b) { return a.image < b.image; });
  return priors;
}

double Radians(double degrees) { return degrees / kDegreesPerRadian; }

// Earth-centred, earth-fixed coordinates of latitude, longitude and height.
Vector3d EarthCentred(const Vector3d& geodetic) {
  // WGS84: the semi-major axis is 6378137 m.
  const double flattening = 1 / 298.257223563;
  const double squared_eccentricity = flattening * (2 - flattening);
  const double latitude = Radians(geodetic[0]);
  const double longitude = Radians(geodetic[1]);
  const double sine = std::sin(latitude);
  const double normal =
      6378137 / std::sqrt(1 - squared_eccentricity * sine * sine);
  return {(normal + geodetic[2]) * std::cos(latitude) * std::cos(longitude),
          (normal + geodetic[2]) * std::cos(latitude) * std::sin(longitude),
          (normal * (1 - squared_eccentricity) + geodetic[2]) * sine};
}

// A rotation whose rows are east, north and up.
Matrix3d LocalFromEarthCentred(const Vector3d& geodetic) {
  const double latitude = Radians(geodetic[0]);
  const double longitude = Radians(geodetic[1]);
  const Vector3d up(std::cos(latitude) * std::cos(longitude),
                    std::cos(latitude) * std::sin(longitude),
                    std::sin(latitude));
  const Vector3d east(-std::sin(longitude), std::cos(longitude), 0);
  Matrix3d rotation;
  rotation << east.transpose(), up.cross(east).transpose(), up.transpose();
  return rotation;
}

void TakeIntoLocalFrame(const Model& model, SqliteDatabase* database,
                        const std::string& source, const FileNote& note,
                        std::vector<PosePrior>* priors) {
  std::vector<Vector3d> places;
  for (const PosePrior& prior : *priors) {
    if (std::abs(prior.position[0]) > 90 || std::abs(prior.position[1]) > 360) {
      database->Fail("found latitude " + std::to_string(prior.position[0]) +
                     " and longitude " + std::to_string(prior.position[1]) +
                     " of image \"" + model.images[prior.image].name +
                     "\", expected degrees");
    }
    places.push_back(EarthCentred(prior.position));
  }
  const Vector3d median = MedianPlace(places);
  size_t nearest = 0;
  for (size_t n = 0; n < places.size(); ++n) {
    if ((places[n] - median).norm() < (places[nearest] - median).norm()) {
      nearest = n;
    }
  }
  const Vector3d origin = (*priors)[nearest].position;
  const Matrix3d rotation = LocalFromEarthCentred(origin);
  for (size_t n = 0; n < places.size(); ++n) {
    (*priors)[n].position = rotation * (places[n] - places[nearest]);
  }
  if (!note) return;
  char at[96];
  std::snprintf(at, sizeof(at), "%.8f %.8f %.3f", origin[0], origin[1],
                origin[2]);
  note(source +
       ": latitudes and longitudes (WGS84) are taken into east, north and up, "
       "metres, at " +
       at + ", where " + model.images[(*priors)[nearest].image].name + " is");
}

// The ellipsoid of three standard deviations; none unless the covariance has an
// inverse.
std::optional<Ellipsoid> RegionOfPrior(const PosePrior& prior) {
  if (!prior.covariance) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(*prior.covariance);
  if (!(solver.eigenvalues().minCoeff() > 0)) return std::nullopt;
  Matrix3d axes = solver.eigenvectors();
  if (axes.determinant() < 0) axes.col(0) = -axes.col(0);
  Ellipsoid region{prior.position,
                   kRegionSigmas * solver.eigenvalues().cwiseSqrt(),
                   Eigen::Quaterniond(axes)};
  if (!IsFit(region)) return std::nullopt;
  return region;
}

}  // namespace

std::vector<KnownPosition> ReadPosePriors(const std::filesystem::path& path,
                                          const Model& model,
                                          const PositionsOptions& options) {
  SqliteDatabase database(path);
  std::vector<PosePrior> priors = ReadRows(&database, model);
  database.RequireUnchanged();
  if (priors.empty()) {
    database.Fail(
        "found no pose prior of the model's images, expected positions; colmap "
        "feature_extractor takes them from EXIF");
  }
  const auto num_geodetic =
      std::count_if(priors.begin(), priors.end(),
                    [](const auto& prior) { return prior.is_geodetic; });
  if (num_geodetic == static_cast<int64_t>(priors.size())) {
    TakeIntoLocalFrame(model, &database, path.string(), options.on_note,
                       &priors);
  } else if (num_geodetic > 0) {
    database.Fail("found " + std::to_string(num_geodetic) + " of " +
                  std::to_string(priors.size()) +
                  " pose priors in WGS84, expected all or none");
  }
  std::vector<KnownPosition> positions;
  for (const PosePrior& prior : priors) {
    positions.push_back({KnownPosition::Of::kImage, prior.image,
                         RegionOfPrior(prior).value_or(BallAround(
                             prior.position, options.radius.value_or(0)))});
  }
  return positions;
}

}  // namespace krot::internal
