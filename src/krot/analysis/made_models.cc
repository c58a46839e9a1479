#include "krot/analysis/model_statistics.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "krot/analysis/camera_check.h"
#include "krot/analysis/model_input.h"
#include "krot/analysis/noise.h"
#include "krot/camera/camera_model.h"
#include "krot/check.h"
#include "krot/context.h"
#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/model/model_checks.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

constexpr std::array<std::array<uint8_t, 3>, 6> kStops = {{{58, 110, 165},
                                                           {53, 151, 143},
                                                           {127, 188, 65},
                                                           {244, 180, 26},
                                                           {230, 85, 13},
                                                           {190, 0, 60}}};

// The largest finite error of the point's track; NaN if none is finite.
double LargestError(const std::vector<double>& errors_px,
                    const Point3D& point) {
  double largest_px = std::numeric_limits<double>::quiet_NaN();
  for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
    if (!std::isfinite(errors_px[e])) continue;
    largest_px = std::fmax(largest_px, errors_px[e]);
  }
  return largest_px;
}

}  // namespace

std::array<uint8_t, 3> ErrorColor(double error_px, double top_px) {
  if (!std::isfinite(error_px)) return {128, 128, 128};
  const double share = std::clamp(error_px / top_px, 0.0, 1.0);
  const double place = share * static_cast<double>(kStops.size() - 1);
  const size_t stop = std::min(kStops.size() - 2, static_cast<size_t>(place));
  const double weight = place - static_cast<double>(stop);
  std::array<uint8_t, 3> color;
  for (size_t i = 0; i < color.size(); ++i) {
    const double low = kStops[stop][i];
    const double high = kStops[stop + 1][i];
    color[i] = static_cast<uint8_t>(std::lround(low + weight * (high - low)));
  }
  return color;
}

void ColorPointsByError(const std::vector<double>& errors_px, double top_px,
                        Model* model) {
  for (Point3D& point : model->points3D) {
    point.color = ErrorColor(LargestError(errors_px, point), top_px);
  }
}

namespace {

// What is added to the ids of a model.
struct IdOffsets {
  CameraId camera = 0;
  ImageId image = 0;
  RigId rig = 0;
  FrameId frame = 0;
  Point3DId point3D = 0;
};

template <typename Record>
uint64_t MaxId(const std::vector<Record>& records) {
  uint64_t max_id = 0;
  for (const Record& record : records) {
    max_id = std::max<uint64_t>(max_id, record.id);
  }
  return max_id;
}

// The largest id of a camera or another sensor, as they share one range of ids.
uint64_t MaxSensorId(const Model& model) {
  uint64_t max_id = MaxId(model.cameras);
  for (const Rig& rig : model.rigs) {
    if (rig.ref_sensor_id) {
      max_id = std::max<uint64_t>(max_id, rig.ref_sensor_id->id);
    }
    for (const RigSensor& sensor : rig.sensors) {
      max_id = std::max<uint64_t>(max_id, sensor.sensor_id.id);
    }
  }
  return max_id;
}

// The least power of ten above `max_id1`, which is added to ids up to
// `max_id2`. The largest value of the type is no id.
template <typename Id>
Id Offset(uint64_t max_id1, uint64_t max_id2, const std::string& kind) {
  constexpr uint64_t kLimit = std::numeric_limits<Id>::max();
  uint64_t offset = 10;
  while (offset <= max_id1 && offset <= kLimit / 10) offset *= 10;
  if (offset <= max_id1 || max_id2 >= kLimit - offset) {
    throw ModelError("the " + kind + " ids of the two models reach " +
                     std::to_string(max_id1) + " and " +
                     std::to_string(max_id2) +
                     ", too large for one model that holds both");
  }
  return static_cast<Id>(offset);
}

IdOffsets Offsets(const Model& model1, const Model& model2) {
  return {
      Offset<CameraId>(MaxSensorId(model1), MaxSensorId(model2), "camera"),
      Offset<ImageId>(MaxId(model1.images), MaxId(model2.images), "image"),
      Offset<RigId>(MaxId(model1.rigs), MaxId(model2.rigs), "rig"),
      Offset<FrameId>(MaxId(model1.frames), MaxId(model2.frames), "frame"),
      Offset<Point3DId>(MaxId(model1.points3D), MaxId(model2.points3D),
                        "point"),
  };
}

void RenumberRigs(const IdOffsets& offsets, Model* model) {
  for (Rig& rig : model->rigs) {
    rig.id += offsets.rig;
    if (rig.ref_sensor_id) rig.ref_sensor_id->id += offsets.camera;
    for (RigSensor& sensor : rig.sensors) {
      sensor.sensor_id.id += offsets.camera;
    }
  }
  for (Frame& frame : model->frames) {
    frame.id += offsets.frame;
    frame.rig_id += offsets.rig;
    for (FrameData& data : frame.data) {
      data.sensor_id.id += offsets.camera;
      data.data_id += offsets.image;
    }
  }
}

void Renumber(const IdOffsets& offsets, Model* model) {
  for (Camera& camera : model->cameras) camera.id += offsets.camera;
  RenumberRigs(offsets, model);
  for (Image& image : model->images) {
    image.id += offsets.image;
    image.camera_id += offsets.camera;
    for (Point2D& point2D : image.points2D) {
      if (point2D.point3D_id == kInvalidPoint3DId) continue;
      point2D.point3D_id += offsets.point3D;
    }
  }
  for (Point3D& point : model->points3D) point.id += offsets.point3D;
  for (TrackElement& element : model->track_elements) {
    element.image_id += offsets.image;
  }
}

void Mark(const std::string& prefix, const std::array<uint8_t, 3>& color,
          Model* model) {
  for (Image& image : model->images) image.name = prefix + image.name;
  for (Point3D& point : model->points3D) point.color = color;
}

template <typename Record>
void MoveRecords(std::vector<Record>* from, std::vector<Record>* to) {
  to->insert(to->end(), std::make_move_iterator(from->begin()),
             std::make_move_iterator(from->end()));
}

Model Join(Model model1, Model model2) {
  Model joined = std::move(model1);
  joined.stores_rigs = joined.stores_rigs || model2.stores_rigs;
  const uint64_t num_elements = joined.track_elements.size();
  for (Point3D& point : model2.points3D) {
    point.track_begin += num_elements;
    point.track_end += num_elements;
  }
  MoveRecords(&model2.cameras, &joined.cameras);
  MoveRecords(&model2.rigs, &joined.rigs);
  MoveRecords(&model2.frames, &joined.frames);
  MoveRecords(&model2.images, &joined.images);
  MoveRecords(&model2.points3D, &joined.points3D);
  MoveRecords(&model2.track_elements, &joined.track_elements);
  return joined;
}

}  // namespace

Model OverlayModels(const Model& model1, const Model& model2, int num_threads) {
  Model first = model1;
  Model second = model2;
  DropUnknownPoints3D(&first);  // the other model may use these ids
  DropUnknownPoints3D(&second);
  Renumber(Offsets(first, second), &second);
  Mark("1/", kOverlayColor1, &first);
  Mark("2/", kOverlayColor2, &second);
  Model overlay = Join(std::move(first), std::move(second));
  if (overlay.stores_rigs) FollowFrames(&overlay);
  UpdatePointErrors(PixelErrors(overlay, num_threads), &overlay);
  return overlay;
}

}  // namespace krot::internal

namespace krot {

using namespace internal;

namespace {

// Moves images whose position alone is wrong to where their matches fit, unless
// other images share their frame. Returns whether there are any.
bool MoveImages(const PairCheck& pairs, Model* moved) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(*moved);
  std::vector<int> num_images(moved->frames.size(), 0);
  for (const ImageGeometry& geometry : geometries) {
    if (geometry.has_pose) ++num_images[geometry.frame];
  }
  bool is_any = false;
  for (size_t n = 0; n < geometries.size(); ++n) {
    const ImageGeometry& geometry = geometries[n];
    if (pairs.images[n].fault != PoseFault::kPosition ||
        num_images[geometry.frame] > 1) {
      continue;
    }
    const RigidTransform& to = pairs.images[n].moved_cam_from_world;
    moved->frames[geometry.frame].rig_from_world.translation =
        (Inverse(geometry.cam_from_rig) * to).translation;
    moved->images[n].cam_from_world.translation = to.translation;
    is_any = true;
  }
  return is_any;
}

bool Fits(const Model& model, double sigma_px) {
  uint64_t size = 0;
  for (const Camera& camera : model.cameras) {
    size = std::max({size, camera.width, camera.height});
  }
  return sigma_px <= std::max(kFilteredPx, 0.01 * static_cast<double>(size));
}

// Marks the track elements that are wrong, or of wrong images.
std::vector<char> WrongElements(const Model& model, const ModelCheck& check) {
  std::vector<char> is_wrong;
  for (const int32_t n : ImagesOfElements(model)) {
    is_wrong.push_back(check.images[n].verdict == ImageVerdict::kWrong);
  }
  for (const WrongObservation& one : check.observations) {
    is_wrong[one.element] = 1;
  }
  for (const int32_t k : check.still_points) {
    const Point3D& point = model.points3D[k];
    std::fill(is_wrong.begin() + static_cast<int64_t>(point.track_begin),
              is_wrong.begin() + static_cast<int64_t>(point.track_end), 1);
  }
  return is_wrong;
}

// Those whose median error is above what passes COLMAP's filter and noise
// explains, and falls to a quarter where their images see them. Wrong
// observations may have bent a point; then it is not counted.
std::vector<int32_t> MisplacedPoints(const Model& model,
                                     const ModelCheck& check,
                                     const Context& context) {
  const std::vector<char> is_wrong = WrongElements(model, check);
  Model moved = model;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    moved.points3D[k].xyz = check.points[k];
  }
  const std::vector<double> errors = PixelErrors(model, context.num_threads);
  const std::vector<double> moved_errors =
      PixelErrors(moved, context.num_threads);
  const double least =
      std::max(kFilteredPx, check.critical_w * *check.sigma_px);
  std::vector<int32_t> misplaced;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    std::vector<double> before, after;
    bool is_any_wrong = false;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      is_any_wrong |= is_wrong[e] != 0;
      before.push_back(errors[e]);
      after.push_back(moved_errors[e]);
    }
    if (is_any_wrong || before.empty()) continue;
    const double median = LowerMedian(std::move(before));
    if (median > least && LowerMedian(std::move(after)) < median / 4) {
      misplaced.push_back(static_cast<int32_t>(k));
    }
  }
  return misplaced;
}

Model Removed(const Model& model, const ModelCheck& check,
              const Context& context) {
  if (!check.IsAnythingWrong()) return model;
  std::vector<char> is_wrong_image;
  for (const ImageCheck& image : check.images) {
    is_wrong_image.push_back(image.verdict == ImageVerdict::kWrong);
  }
  const std::vector<char> is_removed = WrongElements(model, check);
  Model moved = model;
  for (const int32_t k : check.misplaced_points) {
    moved.points3D[k].xyz = check.points[k];
  }
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    bool is_any = check.conventions && check.conventions->has_wrong_points;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      is_any |= is_removed[e];
    }
    if (is_any) moved.points3D[k].xyz = check.points[k];
  }
  Model cured = RemoveImages(
      RemoveObservations(moved, is_removed, /*drops_short=*/false).model,
      is_wrong_image);
  UpdatePointErrors(PixelErrors(cured, context.num_threads), &cured);
  return cured;
}

}  // namespace

int64_t ModelCheck::NumImages(ImageVerdict verdict) const {
  return std::count_if(
      images.begin(), images.end(),
      [&](const ImageCheck& image) { return image.verdict == verdict; });
}

ModelCheck CheckModel(const Model& model, const ModelCheckOptions& options,
                      const Context& context) {
  const auto conventions = FindConventions(model, options.database, context);
  std::optional<Model> converted;
  if (conventions) converted = ConvertModel(model, *conventions, context);
  const Model& read = converted ? *converted : model;
  ModelCheck check = CheckConverted(read, options, context);
  check.conventions = conventions;
  check.still_points = FindStillPoints(read);
  for (WrongCamera& wrong : check.cameras) {
    if (wrong.fault != CameraFault::kFocalLength) continue;
    const Camera& camera =
        read.cameras[*IdIndex<CameraId>(read.cameras).Find(wrong.camera_id)];
    const auto first = camera.params.begin();
    wrong.focal_lengths_px.assign(
        first, first + FindCameraModel(camera.model_id)->num_focal_lengths());
  }
  if (check.sigma_px && !context.IsCancelled()) {
    check.fits = Fits(read, *check.sigma_px);
    if (check.fits && check.is_adjusted) {
      check.misplaced_points = MisplacedPoints(read, check, context);
    }
    // FindConventions calls most points wrong unless cameras are why.
    if (2 * check.misplaced_points.size() > read.points3D.size()) {
      check.misplaced_points.clear();
      check.is_adjusted = false;
    }
  }
  // Such points look like a wrong lens or the same photo.
  if (!check.still_points.empty()) {
    check.cameras.clear();
  } else {
    check.same_photos = FindSamePhotos(model);
  }
  return check;
}

ModelCure CureModel(const Model& model, const ModelCheck& check,
                    const ModelCheckOptions& options, const Context& context) {
  Model moved = check.conventions
                    ? ConvertModel(model, *check.conventions, context)
                    : model;
  if (!check.pairs || !MoveImages(*check.pairs, &moved)) {
    return {Removed(moved, check, context), {}};
  }
  ModelCheck again = CheckModel(moved, options, context);
  again.conventions = check.conventions;
  ModelCure cure = {Removed(moved, again, context), {}};
  for (size_t n = 0; n < check.images.size(); ++n) {
    if (check.pairs->images[n].is_wrong &&
        again.images[n].verdict != ImageVerdict::kWrong) {
      cure.moved.push_back(check.images[n].name);
    }
  }
  return cure;
}

}  // namespace krot
