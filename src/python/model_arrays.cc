#include "python/model_arrays.h"

#include <stdexcept>
#include <utility>

#include "krot/base/check.h"
#include "krot/camera/camera_model.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

namespace py = pybind11;

// Checks that an array has `shape`, in which -1 stands for any length.
template <typename T>
void CheckShape(const CArray<T>& array, const std::vector<int64_t>& shape,
                const char* name) {
  bool fits = array.ndim() == static_cast<int64_t>(shape.size());
  std::string expected;
  std::string found;
  for (size_t d = 0; d < shape.size(); ++d) {
    fits = fits && (shape[d] < 0 || array.shape(d) == shape[d]);
    expected += (d > 0 ? ", " : "") +
                (shape[d] < 0 ? std::string("n") : std::to_string(shape[d]));
  }
  for (int64_t d = 0; d < array.ndim(); ++d) {
    found += (d > 0 ? ", " : "") + std::to_string(array.shape(d));
  }
  if (!fits) {
    throw std::invalid_argument(std::string(name) + " has the shape (" + found +
                                "), must have (" + expected + ")");
  }
}

void CheckIndices(const CArray<int64_t>& indices, int64_t count,
                  const char* name) {
  for (int64_t n = 0; n < indices.size(); ++n) {
    if (indices.data()[n] >= 0 && indices.data()[n] < count) continue;
    throw std::invalid_argument(std::string(name) + "[" + std::to_string(n) +
                                "] = " + std::to_string(indices.data()[n]) +
                                ", must be in [0, " + std::to_string(count) +
                                ")");
  }
}

std::vector<Camera> MakeCameras(const std::vector<CameraTuple>& tuples) {
  std::vector<Camera> cameras;
  for (const auto& [name, width, height, params] : tuples) {
    const CameraModelInfo* info = FindCameraModel(name);
    if (info == nullptr) {
      throw std::invalid_argument("camera model " + name + " is unknown");
    }
    cameras.push_back({static_cast<CameraId>(cameras.size() + 1), info->id,
                       width, height, params});
  }
  return cameras;
}

// Makes the tracks, one point after another, each in the order of the
// observations.
void MakeTracks(const CArray<int64_t>& image_indices,
                const CArray<int64_t>& point_indices, Model* model) {
  const int64_t* points = point_indices.data();
  const int64_t count = point_indices.size();
  for (int64_t n = 0; n < count; ++n) ++model->points3D[points[n]].track_end;
  uint64_t end = 0;
  for (Point3D& point : model->points3D) {
    point.track_begin = end;
    end += std::exchange(point.track_end, end);
  }
  model->track_elements.resize(count);
  std::vector<uint32_t> num_seen(model->images.size(), 0);
  for (int64_t n = 0; n < count; ++n) {
    const int64_t image = image_indices.data()[n];
    model->track_elements[model->points3D[points[n]].track_end++] = {
        model->images[image].id, num_seen[image]++};
  }
}

}  // namespace

std::shared_ptr<Model> ModelFromArrays(const CArray<double>& observations,
                                       const CArray<int64_t>& image_indices,
                                       const CArray<int64_t>& point_indices,
                                       const CArray<double>& rotations,
                                       const CArray<double>& translations,
                                       const CArray<double>& points,
                                       const std::vector<CameraTuple>& cameras,
                                       const CArray<int64_t>& camera_indices,
                                       const std::vector<std::string>& names) {
  const int64_t num_images = static_cast<int64_t>(names.size());
  CheckShape(observations, {-1, 2}, "observations");
  CheckShape(image_indices, {observations.shape(0)}, "image_indices");
  CheckShape(point_indices, {observations.shape(0)}, "point_indices");
  CheckShape(rotations, {num_images, 3, 3}, "rotations");
  CheckShape(translations, {num_images, 3}, "translations");
  CheckShape(points, {-1, 3}, "points");
  CheckShape(camera_indices, {num_images}, "camera_indices");
  CheckIndices(image_indices, num_images, "image_indices");
  CheckIndices(point_indices, points.shape(0), "point_indices");
  CheckIndices(camera_indices, static_cast<int64_t>(cameras.size()),
               "camera_indices");

  auto model = std::make_shared<Model>();
  model->cameras = MakeCameras(cameras);
  for (int64_t n = 0; n < num_images; ++n) {
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>
        rotation(rotations.data() + 9 * n);
    const auto nearest = NearestRotation(rotation);
    if (!nearest || !((*nearest - rotation).norm() < 1e-6)) {
      throw std::invalid_argument("rotations[" + std::to_string(n) +
                                  "] is no rotation matrix");
    }
    Image image;
    image.id = static_cast<ImageId>(n + 1);
    image.camera_id = static_cast<CameraId>(camera_indices.data()[n] + 1);
    image.name = names[n];
    image.cam_from_world = ToPose({*nearest, Eigen::Map<const Eigen::Vector3d>(
                                                 translations.data() + 3 * n)});
    model->images.push_back(std::move(image));
  }
  for (int64_t k = 0; k < points.shape(0); ++k) {
    Point3D point;
    point.id = static_cast<Point3DId>(k + 1);
    point.xyz = Eigen::Map<const Eigen::Vector3d>(points.data() + 3 * k);
    model->points3D.push_back(point);
  }
  for (int64_t n = 0; n < observations.shape(0); ++n) {
    const double* pixel = observations.data() + 2 * n;
    model->images[image_indices.data()[n]].points2D.push_back(
        {pixel[0], pixel[1],
         static_cast<Point3DId>(point_indices.data()[n] + 1)});
  }
  MakeTracks(image_indices, point_indices, model.get());
  UseTrivialRigs(model.get());
  ValidateModel(*model);
  return model;
}

}  // namespace krot::internal
