#pragma once

#include <cmath>
#include <sstream>
#include <string>

#include "krot/context.h"
#include "krot/model.h"
#include "krot/model/id_index.h"

namespace krot::internal {

// What the parts of ValidateModel share.

// A model and where its ids are.
struct IndexedModel {
  explicit IndexedModel(const Model& model)
      : records(model),
        cameras(model.cameras),
        rigs(model.rigs),
        frames(model.frames),
        images(model.images),
        points3D(model.points3D) {}

  const Model& records;
  IdIndex<CameraId> cameras;
  IdIndex<RigId> rigs;
  IdIndex<FrameId> frames;
  IdIndex<ImageId> images;
  IdIndex<Point3DId> points3D;
};

// What ValidateModel says of rigs and frames, their own unique ids excepted.
void ValidateRigsAndFrames(const IndexedModel& model);
// References of tracks to 2D points. Requires valid track ranges.
void ValidateObservations(const IndexedModel& model);

// Throws the parts, one after another, as a ModelError.
template <typename... Parts>
[[noreturn]] void Fail(const Parts&... parts) {
  std::ostringstream message;
  message.precision(17);
  (message << ... << parts);
  throw ModelError(message.str());
}

// `image 3 ("a.jpg")`.
inline std::string Describe(const Image& image) {
  return "image " + std::to_string(image.id) + " (\"" + image.name + "\")";
}

// `owner()` names the record that the value belongs to.
template <typename Owner>
void CheckFinite(double value, const Owner& owner, const char* quantity) {
  if (std::isfinite(value)) return;
  Fail(owner(), ": found ", quantity, " ", value, ", expected a finite number");
}

}  // namespace krot::internal
