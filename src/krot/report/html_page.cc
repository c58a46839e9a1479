#include "krot/report/html_page.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <string_view>
#include <unordered_map>

#include <Eigen/Core>

#include "krot/analysis/model_statistics.h"
#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/report/html_page_template.h"
#include "krot/report/report_json.h"

namespace krot::internal {
namespace {

constexpr char kDigits[] =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

}  // namespace

std::string Base64(const unsigned char* bytes, size_t size) {
  std::string text;
  text.reserve((size + 2) / 3 * 4);
  for (size_t i = 0; i < size; i += 3) {
    const size_t num_bytes = std::min<size_t>(3, size - i);
    uint32_t bits = 0;
    for (size_t k = 0; k < 3; ++k) {
      bits = bits << 8 | (k < num_bytes ? bytes[i + k] : 0u);
    }
    for (size_t k = 0; k < 4; ++k) {
      const uint32_t digit = bits >> (18 - 6 * k) & 63u;
      text += k <= num_bytes ? kDigits[digit] : '=';
    }
  }
  return text;
}

namespace {

size_t HistogramBin(double error_px) {
  const double bin =
      std::floor((std::log10(error_px) - ErrorHistogram::kMinExponent) *
                 ErrorHistogram::kBinsPerDecade);
  return bin > 0 ? static_cast<size_t>(bin) : 0;  // log10(0) = -infinity
}

int64_t NextRank(int64_t rank) {
  return std::max(rank + 1,
                  static_cast<int64_t>(1.05 * static_cast<double>(rank)));
}

}  // namespace

ErrorHistogram ComputeErrorHistogram(const std::vector<double>& errors_px) {
  ErrorHistogram histogram;
  for (const double error_px : errors_px) {
    if (!std::isfinite(error_px)) continue;
    const size_t bin = HistogramBin(error_px);
    if (bin >= histogram.counts.size()) histogram.counts.resize(bin + 1);
    ++histogram.counts[bin];
  }
  return histogram;
}

std::vector<std::pair<int64_t, double>> ErrorTail(
    std::vector<double> errors_px) {
  errors_px.erase(
      std::remove_if(errors_px.begin(), errors_px.end(),
                     [](double error) { return !std::isfinite(error); }),
      errors_px.end());
  std::sort(errors_px.begin(), errors_px.end(), std::greater<>());
  const auto num_errors = static_cast<int64_t>(errors_px.size());
  std::vector<std::pair<int64_t, double>> tail;
  for (int64_t rank = 1; rank < num_errors; rank = NextRank(rank)) {
    tail.emplace_back(rank, errors_px[rank - 1]);
  }
  if (num_errors > 0) tail.emplace_back(num_errors, errors_px.back());
  return tail;
}

namespace {

// The errors of each point, in the order of Model::points3D; NaN if none is
// finite.
struct PointErrors {
  std::vector<float> max_px;
  std::vector<float> mean_px;
};

PointErrors ErrorsByPoint(const Model& model,
                          const std::vector<double>& errors_px) {
  PointErrors errors;
  for (const Point3D& point : model.points3D) {
    double max = 0;
    double sum = 0;
    int64_t count = 0;
    for (uint64_t i = point.track_begin; i < point.track_end; ++i) {
      if (!std::isfinite(errors_px[i])) continue;
      max = std::max(max, errors_px[i]);
      sum += errors_px[i];
      ++count;
    }
    constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
    errors.max_px.push_back(count > 0 ? static_cast<float>(max) : kNone);
    errors.mean_px.push_back(
        count > 0 ? static_cast<float>(sum / static_cast<double>(count))
                  : kNone);
  }
  return errors;
}

Json PointsJson(const Model& model, const std::vector<int64_t>& selection,
                const PointErrors& errors, const Eigen::Vector3d& origin) {
  std::vector<uint64_t> ids;
  std::vector<float> xyz;
  std::vector<uint8_t> rgb;
  std::vector<float> max_error;
  std::vector<float> mean_error;
  std::vector<uint32_t> track_length;
  for (const int64_t index : selection) {
    const Point3D& point = model.points3D[index];
    ids.push_back(point.id);
    for (int axis = 0; axis < 3; ++axis) {
      xyz.push_back(static_cast<float>(point.xyz[axis] - origin[axis]));
      rgb.push_back(point.color[axis]);
    }
    max_error.push_back(errors.max_px[index]);
    mean_error.push_back(errors.mean_px[index]);
    track_length.push_back(
        static_cast<uint32_t>(point.track_end - point.track_begin));
  }
  return {{"num", selection.size()},
          {"ids", Base64(ids)},
          {"xyz", Base64(xyz)},
          {"rgb", Base64(rgb)},
          {"max_error", Base64(max_error)},
          {"mean_error", Base64(mean_error)},
          {"track_length", Base64(track_length)}};
}

// Half the width and height of the image on the plane z = 1, to first order
// around the axis. Bounded, so that wide cameras can be drawn as well.
Eigen::Vector2d HalfExtent(const Camera& camera) {
  constexpr double kMin = 0.05;
  constexpr double kMax = 1.5;
  if (!FindCameraModel(camera.model_id)->has_image_plane) return {kMax, kMax};
  const Eigen::Matrix2d J = ProjectionJacobian(camera, Eigen::Vector2d::Zero());
  const auto bounded = [&](double half_extent) {
    return std::isfinite(half_extent) ? std::clamp(half_extent, kMin, kMax)
                                      : kMax;
  };
  return {bounded(static_cast<double>(camera.width) / (2 * J(0, 0))),
          bounded(static_cast<double>(camera.height) / (2 * J(1, 1)))};
}

Json ImageJson(const ImageErrors& image, const Camera& camera,
               const ImageGeometry& geometry) {
  Json center;
  Json world_from_cam;
  if (geometry.has_pose) {
    const RigidTransform inverse = Inverse(geometry.cam_from_world);
    center = VectorJson(inverse.translation);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        world_from_cam.push_back(inverse.rotation(row, column));
      }
    }
  }
  const Eigen::Vector2d half_extent = HalfExtent(camera);
  return {{"image_id", image.image_id},
          {"name", image.image_name},
          {"camera_id", camera.id},
          {"camera_model", FindCameraModel(camera.model_id)->name},
          {"center", center},
          {"world_from_cam", world_from_cam},
          {"half_extent", {half_extent.x(), half_extent.y()}},
          {"pixel_error",
           Joined({{"count", image.errors.count}}, ErrorJson(image.errors))}};
}

Json ViewedImagesJson(const Model& model,
                      const std::vector<double>& errors_px) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const std::vector<ImageErrors> errors = ErrorsByImage(model, errors_px);
  std::unordered_map<CameraId, const Camera*> cameras;
  for (const Camera& camera : model.cameras) cameras[camera.id] = &camera;
  Json json = Json::array();
  for (size_t i = 0; i < model.images.size(); ++i) {
    json.push_back(ImageJson(errors[i], *cameras.at(model.images[i].camera_id),
                             geometries[i]));
  }
  return json;
}

}  // namespace

std::vector<int64_t> SelectPoints(const std::vector<float>& max_errors,
                                  int64_t max_count) {
  CheckArgument(max_count >= 1, "max_count", max_count, ">= 1");
  const auto num_points = static_cast<int64_t>(max_errors.size());
  auto order = NumbersUpTo<int64_t>(num_points);
  if (num_points <= max_count) return order;

  const auto height = [&max_errors](int64_t index) {
    return std::isnan(max_errors[index]) ? -1.0f : max_errors[index];
  };
  SortLargestFirst(&order, height);
  const int64_t num_worst = max_count / 100;
  std::sort(order.begin() + num_worst, order.end());
  const int64_t num_others = max_count - num_worst;
  const double step = static_cast<double>(num_points - num_worst) /
                      static_cast<double>(num_others);
  for (int64_t k = 0; k < num_others; ++k) {
    order[num_worst + k] =
        order[num_worst + static_cast<int64_t>(step * static_cast<double>(k))];
  }
  order.resize(max_count);
  std::sort(order.begin(), order.end());
  return order;
}

Eigen::Vector3d SceneOrigin(const Model& model) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int64_t count = 0;
  for (const Point3D& point : model.points3D) {
    if (!point.xyz.allFinite()) continue;
    sum += point.xyz;
    ++count;
  }
  return sum / static_cast<double>(std::max<int64_t>(count, 1));
}

std::string ModelViewJson(const Model& model, const Eigen::Vector3d& origin,
                          int64_t max_points, int num_threads) {
  const std::vector<double> errors_px = PixelErrors(model, num_threads);
  const PointErrors point_errors = ErrorsByPoint(model, errors_px);
  const std::vector<int64_t> selection =
      SelectPoints(point_errors.max_px, max_points);
  const Json json = {
      {"num_points", model.points3D.size()},
      {"num_observations", model.track_elements.size()},
      {"origin", VectorJson(origin)},
      {"images", ViewedImagesJson(model, errors_px)},
      {"points", PointsJson(model, selection, point_errors, origin)},
      {"histogram",
       {{"min_exponent", ErrorHistogram::kMinExponent},
        {"bins_per_decade", ErrorHistogram::kBinsPerDecade},
        {"counts", ComputeErrorHistogram(errors_px).counts}}},
      {"tail", ErrorTail(errors_px)},
  };
  // Image names are bytes, not always UTF-8.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

namespace {

// JSON contains '<' only in strings. There it is written as an escape, so that
// no text can end the HTML element that holds it, or begin a comment.
std::string EscapeForScript(const std::string& json) {
  std::string escaped;
  escaped.reserve(json.size());
  for (const char character : json) {
    if (character == '<') {
      escaped += "\\u003c";
    } else {
      escaped += character;
    }
  }
  return escaped;
}

// `text` with every {{name}} replaced by its value. Values themselves are not
// searched for names.
std::string FillTemplate(
    std::string_view text,
    const std::map<std::string_view, std::string>& values) {
  std::string filled;
  for (size_t at = 0;;) {
    const size_t begin = text.find("{{", at);
    filled += text.substr(at, begin - at);
    if (begin == std::string_view::npos) return filled;
    const size_t end = text.find("}}", begin);
    filled += values.at(text.substr(begin + 2, end - begin - 2));
    at = end + 2;
  }
}

}  // namespace

std::string HtmlPage(const std::string& report_json, const Model& before,
                     const Model& after, int num_threads,
                     const std::string& crops_json,
                     const std::string& pairs_json) {
  const Eigen::Vector3d origin = SceneOrigin(before);
  const auto view = [&](const Model& model) {
    return ModelViewJson(model, origin, kMaxShownPoints, num_threads);
  };
  return FillTemplate(
      kHtmlPageTemplate,
      {{"report", EscapeForScript(report_json)},
       {"crops", EscapeForScript(crops_json)},
       {"pairs", EscapeForScript(pairs_json)},
       {"models", EscapeForScript("{\"before\":" + view(before) +
                                  ",\"after\":" + view(after) + "}")}});
}

}  // namespace krot::internal
