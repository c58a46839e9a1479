#include "krot/convert/certificate_file.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <unordered_map>
#include <utility>
#include <vector>

#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

__extension__ using Wide = unsigned __int128;

constexpr bool IsPrime(int n) {
  for (int divisor = 2; divisor * divisor <= n; ++divisor) {
    if (n % divisor == 0) return false;
  }
  return true;
}

// The first 32 bits of the fraction of n's root of that degree.
constexpr uint32_t RootBits(int n, int degree) {
  const Wide target = Wide(n) << (32 * degree);
  Wide root = 0;
  for (int bit = 36; bit >= 0; --bit) {
    const Wide trial = root | (Wide(1) << bit);
    const Wide power = degree == 2 ? trial * trial : trial * trial * trial;
    if (power <= target) root = trial;
  }
  return static_cast<uint32_t>(root);
}

// The RootBits of the first primes.
template <size_t size>
constexpr std::array<uint32_t, size> PrimeRoots(int degree) {
  std::array<uint32_t, size> roots = {};
  size_t found = 0;
  for (int n = 2; found < size; ++n) {
    if (IsPrime(n)) roots[found++] = RootBits(n, degree);
  }
  return roots;
}

constexpr std::array<uint32_t, 8> kStart = PrimeRoots<8>(2);
constexpr std::array<uint32_t, 64> kRounds = PrimeRoots<64>(3);

uint32_t Turn(uint32_t word, int bits) {
  return (word >> bits) | (word << (32 - bits));
}

// Digests bytes as they come, numbers in little-endian order.
class Digest {
 public:
  void Bytes(std::string_view bytes) {
    num_bytes_ += bytes.size();
    for (const char byte : bytes) {
      block_[block_size_++] = static_cast<unsigned char>(byte);
      if (block_size_ == block_.size()) DigestBlock();
    }
  }

  void Integer(uint64_t value) {
    char bytes[8];
    for (char& byte : bytes) {
      byte = static_cast<char>(value & 0xff);
      value >>= 8;
    }
    Bytes({bytes, sizeof(bytes)});
  }

  void Number(double value) {
    uint64_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    Integer(bits);
  }

  // The digest of everything so far; must be the last call.
  std::string Hex() {
    const uint64_t num_bits = 8 * num_bytes_;
    Bytes("\x80");
    while (block_size_ != 56) Bytes({"", 1});
    for (int shift = 56; shift >= 0; shift -= 8) {
      const auto byte = static_cast<char>(num_bits >> shift);
      Bytes({&byte, 1});
    }
    std::string hex;
    for (const uint32_t word : state_) {
      for (int shift = 28; shift >= 0; shift -= 4) {
        hex += "0123456789abcdef"[word >> shift & 15];
      }
    }
    return hex;
  }

 private:
  // Names are those of the standard: the schedule w, the working variables a to
  // h.
  void DigestBlock() {
    std::array<uint32_t, 64> w;
    for (size_t t = 0; t < 16; ++t) {
      w[t] = uint32_t{block_[4 * t]} << 24 | uint32_t{block_[4 * t + 1]} << 16 |
             uint32_t{block_[4 * t + 2]} << 8 | uint32_t{block_[4 * t + 3]};
    }
    for (size_t t = 16; t < 64; ++t) {
      const uint32_t x = w[t - 15], y = w[t - 2];
      w[t] = w[t - 16] + (Turn(x, 7) ^ Turn(x, 18) ^ (x >> 3)) + w[t - 7] +
             (Turn(y, 17) ^ Turn(y, 19) ^ (y >> 10));
    }
    auto [a, b, c, d, e, f, g, h] = state_;
    for (size_t t = 0; t < 64; ++t) {
      const uint32_t t1 = h + (Turn(e, 6) ^ Turn(e, 11) ^ Turn(e, 25)) +
                          ((e & f) ^ (~e & g)) + kRounds[t] + w[t];
      const uint32_t t2 = (Turn(a, 2) ^ Turn(a, 13) ^ Turn(a, 22)) +
                          ((a & b) ^ (a & c) ^ (b & c));
      h = g, g = f, f = e, e = d + t1, d = c, c = b, b = a, a = t1 + t2;
    }
    const std::array<uint32_t, 8> worked = {a, b, c, d, e, f, g, h};
    for (size_t n = 0; n < 8; ++n) state_[n] += worked[n];
    block_size_ = 0;
  }

  std::array<uint32_t, 8> state_ = kStart;
  std::array<unsigned char, 64> block_;
  size_t block_size_ = 0;
  uint64_t num_bytes_ = 0;
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

// For each image id: the 2D points that tracks contain, with their 3D points.
using Observations =
    std::unordered_map<ImageId, std::vector<std::pair<uint32_t, Point3DId>>>;

Observations SortedObservations(const Model& model) {
  Observations observations;
  for (const Point3D& point : model.points3D) {
    for (const TrackElement& element : TrackOf(model, point)) {
      observations[element.image_id].emplace_back(element.point2D_idx,
                                                  point.id);
    }
  }
  for (auto& [image_id, of_image] : observations) {
    std::sort(of_image.begin(), of_image.end());
  }
  return observations;
}

// The pose of the image's camera: its frame, the frame's rotation, and its pose
// in the rig.
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
