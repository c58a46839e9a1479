#include "tools/krot/suspect_crops.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "krot/camera/camera_model.h"
#include "krot/model/rigs.h"
#include "krot/report/html_page.h"
#include "krot/report/text_table.h"
#include "tools/krot/photo.h"

namespace krot::internal {
namespace {

using Eigen::Vector2d;
using Json = nlohmann::ordered_json;

constexpr size_t kMaxShown = 20;
constexpr size_t kMaxPhotosOfTrack = 6;
// Half the side of a crop, pixels; larger where the point projects farther
// away.
constexpr double kSmallestHalf = 32;
constexpr double kLargestHalf = 128;
constexpr double kMargin = 1.3;

// An observation to cut out, and its place in the JSON.
struct Cut {
  size_t suspect = 0;
  size_t place = 0;
  Vector2d pixel;
  std::optional<Vector2d> projection;  // of the result
};

class SuspectCrops {
 public:
  SuspectCrops(const Model& input, const Model& result,
               const OutlierFilterSummary& summary)
      : input_(input),
        result_(result),
        summary_(summary),
        points_(input.points3D),
        kept_points_(result.points3D),
        image_of_(ImageIndices(input)),
        geometry_(ImageGeometries(result)) {
    ListCuts();
  }

  // Adds the crops. Returns how many photos could not be read.
  int64_t AddCrops(const std::string& image_path);
  std::string Text() const { return json_.dump(); }

 private:
  void ListCuts();
  void AddTrack(const RemovedObservation& removed);
  std::optional<Vector2d> Projection(int32_t image, Point3DId id) const;
  Json Crop(const Photo& photo, const Camera& camera, const Cut& cut) const;

  const Model& input_;
  const Model& result_;
  const OutlierFilterSummary& summary_;
  const IdIndex<Point3DId> points_;
  const IdIndex<Point3DId> kept_points_;
  const std::unordered_map<ImageId, int32_t> image_of_;
  const std::vector<ImageGeometry> geometry_;
  Json json_ = Json::array();
  std::map<int32_t, std::vector<Cut>> cuts_;  // by image
};

std::optional<Vector2d> SuspectCrops::Projection(int32_t image,
                                                 Point3DId id) const {
  const std::optional<int32_t> k = kept_points_.Find(id);
  const ImageGeometry& geometry = geometry_[image];
  if (!k || !geometry.has_pose) return std::nullopt;
  const Camera& camera = result_.cameras[geometry.camera];
  return ProjectPoint(camera,
                      geometry.cam_from_world * result_.points3D[*k].xyz);
}

// Adds the track of a removed observation, which itself comes first.
void SuspectCrops::AddTrack(const RemovedObservation& removed) {
  const Point3D& point = input_.points3D[*points_.Find(removed.point3D_id)];
  std::vector<TrackElement> track(
      input_.track_elements.begin() +
          static_cast<std::ptrdiff_t>(point.track_begin),
      input_.track_elements.begin() +
          static_cast<std::ptrdiff_t>(point.track_end));
  std::stable_partition(track.begin(), track.end(),
                        [&](const TrackElement& element) {
                          return element.image_id == removed.image_id &&
                                 element.point2D_idx == removed.point2D_idx;
                        });
  if (track.size() > kMaxPhotosOfTrack) track.resize(kMaxPhotosOfTrack);
  Json views = Json::array();
  for (const TrackElement& element : track) {
    const int32_t n = image_of_.at(element.image_id);
    const Point2D& point2D = input_.images[n].points2D[element.point2D_idx];
    cuts_[n].push_back({json_.size(), views.size(),
                        Vector2d(point2D.x, point2D.y),
                        Projection(n, point.id)});
    views.push_back({{"image_name", input_.images[n].name},
                     {"point2D_idx", element.point2D_idx},
                     {"crop", nullptr}});
  }
  json_.push_back({{"image_name", removed.image_name},
                   {"point2D_idx", removed.point2D_idx},
                   {"point3D_id", removed.point3D_id},
                   {"views", std::move(views)}});
}

void SuspectCrops::ListCuts() {
  std::set<Point3DId> seen;
  for (const RemovedObservation& removed : summary_.removed) {
    if (json_.size() == kMaxShown) return;
    if (seen.insert(removed.point3D_id).second) AddTrack(removed);
  }
}

// A crop and the coordinates in it; photos may have been scaled since.
Json SuspectCrops::Crop(const Photo& photo, const Camera& camera,
                        const Cut& cut) const {
  const Vector2d scale(photo.width / static_cast<double>(camera.width),
                       photo.height / static_cast<double>(camera.height));
  const Vector2d pixel = cut.pixel.cwiseProduct(scale);
  std::optional<Vector2d> projection;
  double half = kSmallestHalf;
  if (cut.projection && cut.projection->allFinite()) {
    projection = cut.projection->cwiseProduct(scale);
    half = std::clamp(kMargin * (*projection - pixel).lpNorm<Eigen::Infinity>(),
                      kSmallestHalf, kLargestHalf);
  }
  const int left = static_cast<int>(std::floor(pixel.x() - half));
  const int top = static_cast<int>(std::floor(pixel.y() - half));
  const int size = static_cast<int>(2 * half);
  const std::vector<uint8_t> jpeg =
      EncodeJpeg(CropPhoto(photo, left, top, size));
  const auto place = [&](const Vector2d& at) {
    return Json::array({at.x() - left, at.y() - top});
  };
  return {{"jpeg", Base64(jpeg)},
          {"size", size},
          {"observed", place(pixel)},
          {"projected", projection ? place(*projection) : Json()}};
}

int64_t SuspectCrops::AddCrops(const std::string& image_path) {
  int64_t num_missing = 0;
  for (const auto& [n, cuts] : cuts_) {
    const Image& image = input_.images[n];
    const std::optional<Photo> photo =
        ReadPhoto((std::filesystem::path(image_path) / image.name).string());
    if (!photo) {
      ++num_missing;
      continue;
    }
    for (const Cut& cut : cuts) {
      json_[cut.suspect]["views"][cut.place]["crop"] =
          Crop(*photo, input_.cameras[geometry_[n].camera], cut);
    }
  }
  return num_missing;
}

void WarnOfMissing(int64_t num_missing, const std::string& image_path,
                   const LogOptions& log) {
  if (num_missing == 0) return;
  LogLine(log, 1,
          "warning: " + Counted(num_missing, "photo") +
              " that the page would show cannot be read in " + image_path);
}

}  // namespace

std::string SuspectCropsJson(const std::string& image_path, const Model& input,
                             const Model& result,
                             const OutlierFilterSummary& summary,
                             const LogOptions& log) {
  SuspectCrops crops(input, result, summary);
  WarnOfMissing(crops.AddCrops(image_path), image_path, log);
  return crops.Text();
}

std::string PairViewWithPhotos(const std::string& image_path,
                               const Model& model, const Database& database,
                               const PairCheck& check, const LogOptions& log) {
  Json view = PairViewJson(model, database, check);
  if (image_path.empty()) return view.dump();
  std::set<int32_t> seen;
  for (const CheckedPair& pair : check.pairs) {
    seen.insert({pair.image1, pair.image2});
  }
  int64_t num_missing = 0;
  for (const int32_t i : seen) {
    const std::optional<Photo> photo = ReadPhoto(
        (std::filesystem::path(image_path) / model.images[i].name).string());
    Json& image = view["images"][i];
    if (!photo) {
      ++num_missing;
      continue;
    }
    const Photo small =
        ShrinkPhoto(*photo, std::min(photo->width, image["width"].get<int>()),
                    std::min(photo->height, image["height"].get<int>()));
    image["jpeg"] = Base64(EncodeJpeg(small));
  }
  WarnOfMissing(num_missing, image_path, log);
  return view.dump();
}

}  // namespace krot::internal
