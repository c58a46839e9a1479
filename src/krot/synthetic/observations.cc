#include "krot/synthetic/observations.h"

#include <algorithm>
#include <array>

namespace krot::internal {
namespace {

constexpr double kTwinDistance = 2;  // pixels, per axis

class ObservationWriter {
 public:
  ObservationWriter(const SceneOptions& options, Random* random, Model* model)
      : options_(options), random_(random), model_(model) {}

  std::vector<int64_t> Write(const Structure& structure) {
    for (size_t k = 0; k < structure.points.size(); ++k) {
      Point3D point;
      point.id = k + 1;
      point.color = RandomColor();
      point.track_begin = model_->track_elements.size();
      for (int64_t n = structure.point_begin[k];
           n < structure.point_begin[k + 1]; ++n) {
        WriteSighting(structure.sightings[static_cast<size_t>(n)], point.id);
      }
      point.track_end = model_->track_elements.size();
      model_->points3D.push_back(point);
    }
    return outliers_;
  }

 private:
  std::array<uint8_t, 3> RandomColor() {
    std::array<uint8_t, 3> color;
    for (uint8_t& channel : color) {
      channel = static_cast<uint8_t>(random_->UniformInt(256));
    }
    return color;
  }

  Eigen::Vector2d RandomPixel() {
    const double x = random_->Uniform(0, options_.image_width);
    const double y = random_->Uniform(0, options_.image_height);
    return {x, y};
  }

  Eigen::Vector2d NoisyPixel(const Eigen::Vector2d& pixel) {
    const double dx = options_.pixel_noise * random_->Gaussian();
    const double dy = options_.pixel_noise * random_->Gaussian();
    return pixel + Eigen::Vector2d(dx, dy);
  }

  void WriteSighting(const Sighting& sighting, Point3DId point_id) {
    if (random_->Chance(options_.outlier_ratio)) {
      outliers_.push_back(static_cast<int64_t>(model_->track_elements.size()));
      WritePoint2D(sighting.image, RandomPixel(), point_id);
    } else {
      WritePoint2D(sighting.image, NoisyPixel(sighting.pixel), point_id);
    }
    if (random_->Chance(options_.duplicate_ratio)) {
      const double dx = random_->Uniform(-kTwinDistance, kTwinDistance);
      const double dy = random_->Uniform(-kTwinDistance, kTwinDistance);
      WritePoint2D(sighting.image,
                   NoisyPixel(sighting.pixel) + Eigen::Vector2d(dx, dy),
                   point_id);
    }
  }

  void WritePoint2D(int image_index, const Eigen::Vector2d& pixel,
                    Point3DId point_id) {
    Image& image = model_->images[static_cast<size_t>(image_index)];
    model_->track_elements.push_back(
        {image.id, static_cast<uint32_t>(image.points2D.size())});
    Point2D point2D;
    point2D.x = std::clamp<double>(pixel.x(), 0, options_.image_width);
    point2D.y = std::clamp<double>(pixel.y(), 0, options_.image_height);
    point2D.point3D_id = point_id;
    image.points2D.push_back(point2D);
  }

  const SceneOptions options_;
  Random* const random_;
  Model* const model_;
  std::vector<int64_t> outliers_;
};

}  // namespace

double ObservationMargin(const SceneOptions& options) {
  const double wanted = 3 * options.pixel_noise +
                        (options.duplicate_ratio > 0 ? kTwinDistance : 0);
  const double smaller_side =
      std::min(options.image_width, options.image_height);
  return std::min(wanted, smaller_side / 8);
}

std::vector<int64_t> WriteObservations(const Structure& structure,
                                       const SceneOptions& options,
                                       Random* random, Model* model) {
  return ObservationWriter(options, random, model).Write(structure);
}

}  // namespace krot::internal
