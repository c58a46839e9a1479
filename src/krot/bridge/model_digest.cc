#include "krot/bridge/model_digest.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <unordered_map>
#include <utility>
#include <vector>

#include "krot/bridge/order_of_ids.h"
#include "krot/bridge/sha256.h"
#include "krot/model/image_geometry.h"

namespace krot::internal {
namespace {

// Collects little-endian bytes and digests them in pieces.
class Digest {
 public:
  void Integer(uint64_t value) {
    std::array<unsigned char, 8> bytes;
    for (unsigned char& byte : bytes) {
      byte = static_cast<unsigned char>(value & 0xff);
      value >>= 8;
    }
    Append(bytes);
  }

  void Number(double value) {
    uint64_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    Integer(bits);
  }

  void Bytes(std::string_view bytes) {
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  }

  std::string Hex() {
    Flush();
    std::string hex;
    for (const unsigned char byte : sha256_.Finish()) {
      hex += "0123456789abcdef"[byte >> 4];
      hex += "0123456789abcdef"[byte & 15];
    }
    return hex;
  }

 private:
  static constexpr size_t kPiece = 1 << 16;

  void Append(const std::array<unsigned char, 8>& bytes) {
    buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
    if (buffer_.size() >= kPiece) Flush();
  }

  void Flush() {
    sha256_.Append(buffer_.data(), buffer_.size());
    buffer_.clear();
  }

  Sha256Stream sha256_;
  std::vector<unsigned char> buffer_;
};

void AddQuaternion(const Pose& pose, Digest* digest) {
  for (const double q : pose.quaternion_wxyz) digest->Number(q);
}

void AddCamera(const Camera& camera, Digest* digest) {
  digest->Integer(camera.id);
  digest->Integer(static_cast<uint64_t>(camera.model_id));
  digest->Integer(camera.params.size());
  for (const double param : camera.params) digest->Number(param);
}

// By image id: which 2D points, and of which 3D points, the tracks name.
using Observations =
    std::unordered_map<ImageId, std::vector<std::pair<uint32_t, Point3DId>>>;

Observations SortedObservations(const Model& model) {
  Observations observations;
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model.track_elements[e];
      observations[element.image_id].emplace_back(element.point2D_idx,
                                                  point.id);
    }
  }
  for (auto& [image_id, of_image] : observations) {
    std::sort(of_image.begin(), of_image.end());
  }
  return observations;
}

// How the image's camera sits: in which frame, how that is turned, where in it.
void AddPlace(const Model& model, const ImageGeometry& image, Digest* digest) {
  digest->Integer(image.frame >= 0);
  if (image.frame < 0) return;
  const Frame& frame = model.frames[image.frame];
  digest->Integer(frame.id);
  AddQuaternion(frame.rig_from_world, digest);
  const Pose cam_from_rig =
      image.sensor < 0
          ? Pose()
          : *model.rigs[image.rig].sensors[image.sensor].sensor_from_rig;
  AddQuaternion(cam_from_rig, digest);
  for (const double t : cam_from_rig.translation) digest->Number(t);
}

void AddObservations(const Image& image, const Observations& observations,
                     Digest* digest) {
  const auto found = observations.find(image.id);
  if (found == observations.end()) {
    digest->Integer(0);
    return;
  }
  digest->Integer(found->second.size());
  for (const auto& [point2D_idx, point3D_id] : found->second) {
    const Point2D& point2D = image.points2D[point2D_idx];
    digest->Integer(point2D_idx);
    digest->Number(point2D.x);
    digest->Number(point2D.y);
    digest->Integer(point3D_id);
  }
}

}  // namespace

std::string ModelSha256(const Model& model) {
  Digest digest;
  digest.Integer(model.cameras.size());
  for (const int32_t n : OrderOfIds(model.cameras)) {
    AddCamera(model.cameras[n], &digest);
  }
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const Observations observations = SortedObservations(model);
  digest.Integer(model.images.size());
  for (const int32_t n : OrderOfIds(model.images)) {
    const Image& image = model.images[n];
    digest.Integer(image.id);
    digest.Integer(image.camera_id);
    AddPlace(model, geometries[n], &digest);
    AddObservations(image, observations, &digest);
  }
  return digest.Hex();
}

std::string Sha256(std::string_view bytes) {
  Digest digest;
  digest.Bytes(bytes);
  return digest.Hex();
}

}  // namespace krot::internal
