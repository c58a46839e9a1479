#include "krot/analysis/model_input.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/context.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

struct SideFit {
  Contradictions::Fit px;      // what does not exist counts as infinite
  Contradictions::Fit told;    // without it
  double relative_median = 0;  // to the image's larger side
  int64_t count = 0;
  bool is_any_finite = false;
};

// Measures the tracks of a valid model, and counts `num_unknown` elements that
// do not exist as infinite errors. None if there is nothing to measure.
std::optional<SideFit> Measure(const Model& model, int64_t num_unknown) {
  const std::vector<double> errors_px = PixelErrors(model);
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::vector<double> px(num_unknown, kInfinity);
  std::vector<double> relative = px;
  SideFit fit;
  for (size_t e = 0; e < errors_px.size(); ++e) {
    const ImageGeometry& image = geometries[image_of[e]];
    if (!image.has_pose) continue;
    const Camera& camera = model.cameras[image.camera];
    const auto side = static_cast<double>(
        std::max({camera.width, camera.height, uint64_t{1}}));
    const bool is_finite = std::isfinite(errors_px[e]);
    fit.is_any_finite |= is_finite;
    px.push_back(is_finite ? errors_px[e] : kInfinity);
    relative.push_back(px.back() / side);
  }
  if (px.empty()) return std::nullopt;
  fit.count = static_cast<int64_t>(px.size());
  fit.px.max = *std::max_element(px.begin(), px.end());
  fit.px.median = Median(px);
  px.erase(px.begin(), px.begin() + num_unknown);
  fit.told = {kNaN, kNaN, num_unknown};
  if (!px.empty()) {
    fit.told.max = *std::max_element(px.begin(), px.end());
    fit.told.median = Median(std::move(px));
  }
  fit.relative_median = Median(relative);
  return fit;
}

Model Followed(Reading reading, const Model& model) {
  Model copy = model;
  Follow(reading, &copy);
  return copy;
}

// Whether the side that `reading` follows is better without the other: it has
// at least half of the observations of kBoth, and a smaller largest error.
bool IsBetterAlone(const Model& model, Reading reading, const SideFit& both) {
  const std::optional<SideFit> alone = Measure(Followed(reading, model), 0);
  return alone && 2 * alone->count >= both.count && alone->px.max < both.px.max;
}

// 2D points that have nothing to do with their 3D points are off by about half
// of the image's larger side.
bool IsRelated(const SideFit& side) { return side.relative_median <= 0.1; }

// The reading that fits the model best; none if neither side fits.
std::optional<Reading> Choose(const Model& model,
                              const std::optional<SideFit>& tracks,
                              const std::optional<SideFit>& images) {
  if (!tracks || !images) return Reading::kBoth;
  if (!IsRelated(*tracks) && !IsRelated(*images)) return std::nullopt;
  // The median errors of two sides that are both right differ by a factor of
  // two and a pixel at most.
  const auto is_clearly_worse = [](const SideFit& side, const SideFit& other) {
    return !IsRelated(side) || side.px.median > 2 * other.px.median + 1;
  };
  if (is_clearly_worse(*tracks, *images)) return Reading::kImages;
  if (is_clearly_worse(*images, *tracks)) return Reading::kTracks;
  const std::optional<SideFit> both =
      Measure(Followed(Reading::kBoth, model), 0);
  if (IsBetterAlone(model, Reading::kImages, *both)) return Reading::kImages;
  if (IsBetterAlone(model, Reading::kTracks, *both)) return Reading::kTracks;
  return Reading::kBoth;
}

const char* Name(Reading reading) {
  switch (reading) {
    case Reading::kTracks:
      return "tracks";
    case Reading::kImages:
      return "images";
    case Reading::kBoth:
      break;
  }
  return "both";
}

}  // namespace

Contradictions SettleContradictions(const std::string& on_contradiction,
                                    Model* model) {
  const bool is_auto = on_contradiction == "auto";
  const bool follows_images = on_contradiction == "follow_images";
  CheckArgument(is_auto || follows_images ||
                    on_contradiction == "follow_tracks" ||
                    on_contradiction == "refuse",
                "on_contradiction", on_contradiction,
                "one of {auto, follow_tracks, follow_images, refuse}");
  Contradictions found = FindContradictions(*model);
  if (!found.Any() || on_contradiction == "refuse") return found;

  const Model by_images = Followed(Reading::kImages, *model);
  ValidateModel(by_images);
  Model by_tracks = *model;
  const int64_t num_unknown = DropUnknownPoints2D(&by_tracks);
  std::optional<SideFit> tracks = Measure(by_tracks, num_unknown);
  std::optional<SideFit> images = Measure(by_images, 0);
  const bool has_positions =
      (tracks && tracks->is_any_finite) || (images && images->is_any_finite);
  if (!has_positions || !(HasTrack(by_tracks) || HasTrack(by_images))) {
    tracks = images = std::nullopt;
  }
  if (tracks) found.of_tracks = tracks->told;
  if (images) found.of_images = images->told;
  if (on_contradiction == "follow_tracks") {
    found.followed = "tracks";
    return found;
  }
  const std::optional<Reading> reading =
      is_auto ? Choose(*model, tracks, images) : Reading::kImages;
  found.followed = reading ? Name(*reading) : "neither";
  if (reading) Follow(*reading, model);
  return found;
}

std::optional<std::pair<double, double>> WorseImagesSide(const Model& before,
                                                         const Model& after,
                                                         Norm norm) {
  if (!FindContradictions(before).Any()) return std::nullopt;
  const Model old = Followed(Reading::kImages, before);
  const std::optional<SideFit> fit = Measure(old, 0);
  if (!fit || !IsRelated(*fit)) return std::nullopt;
  const PixelErrorStatistics errors = Summarize(PixelErrors(old, -1, norm));
  const PixelErrorStatistics errors_after =
      Summarize(PixelErrors(Followed(Reading::kImages, after), -1, norm));
  const double max_after = errors_after.not_finite > errors.not_finite
                               ? kInfinity
                               : errors_after.max;
  const bool is_worse = max_after > errors.max * (1 + 1e-9);  // than rounding
  if (!is_worse) return std::nullopt;
  return std::pair(errors.max, max_after);
}

namespace {

std::optional<double> FiniteMedian(std::vector<double> errors) {
  if (errors.empty()) return std::nullopt;
  for (double& error : errors) {
    if (std::isnan(error)) error = kInfinity;
  }
  const double median = Median(std::move(errors));
  return std::isfinite(median) ? std::optional<double>(median) : std::nullopt;
}

// Keeps the errors that differ, if any do: those of the images that were
// turned.
void KeepChanged(std::vector<double>* before, std::vector<double>* after) {
  size_t num_kept = 0;
  for (size_t n = 0; n < before->size(); ++n) {
    const double was = (*before)[n];
    const double is = (*after)[n];
    if (was == is || (std::isnan(was) && std::isnan(is))) continue;
    (*before)[num_kept] = was;
    (*after)[num_kept++] = is;
  }
  if (num_kept == 0) return;
  before->resize(num_kept);
  after->resize(num_kept);
}

double LargestSide(const Model& model) {
  uint64_t side = 0;
  for (const Camera& camera : model.cameras) {
    side = std::max({side, camera.width, camera.height});
  }
  return static_cast<double>(side);
}

std::string Pixels(const std::optional<double>& error) {
  std::ostringstream text;
  if (error) text << std::fixed << std::setprecision(2) << *error << " px";
  return error ? text.str() : "infinite, behind the cameras";
}

}  // namespace

RotationInput TakeRotations(const FileBytes& file, Model* model,
                            int num_threads, const FileNote& note) {
  RotationInput input;
  std::vector<double> before = PixelErrors(*model, num_threads);
  input.replaced = ReplaceRotations(file, model, note);
  std::vector<double> after = PixelErrors(*model, num_threads);
  KeepChanged(&before, &after);
  input.median_error_before = FiniteMedian(std::move(before));
  input.median_error_after = FiniteMedian(std::move(after));
  const bool model_fits =
      input.median_error_before &&
      *input.median_error_before <= 0.01 * LargestSide(*model);
  if (input.replaced.mistake.empty() || !model_fits) return input;
  // A wrong convention multiplies errors by far more than five.
  const bool is_far_worse =
      !input.median_error_after ||
      5 * *input.median_error_before < *input.median_error_after;
  if (is_far_worse) {
    throw ModelError(file.path + ": " + input.replaced.mistake +
                     "; the median error is " +
                     Pixels(input.median_error_before) +
                     " with the model's own, with these " +
                     Pixels(input.median_error_after));
  }
  return input;
}

std::string NameOf(const Model& model, const KnownPosition& position) {
  return position.of == KnownPosition::Of::kImage
             ? model.images[position.index].name
             : "3D point " + std::to_string(model.points3D[position.index].id);
}

std::optional<Eigen::Vector3d> PlaceOf(const Model& model,
                                       const std::vector<ImageGeometry>& images,
                                       const KnownPosition& position) {
  if (position.of == KnownPosition::Of::kPoint3D) {
    return model.points3D[position.index].xyz;
  }
  const ImageGeometry& image = images[position.index];
  if (!image.has_pose) return std::nullopt;
  return Center(image.cam_from_world);
}

std::vector<KnownPosition> InOwnFrame(const PositionFrame& frame) {
  const Similarity& own_from_model = frame.own_from_model;
  std::vector<KnownPosition> positions = frame.positions;
  for (KnownPosition& position : positions) {
    Ellipsoid& region = position.region;
    region.centre = own_from_model * region.centre;
    region.semi_axes *= own_from_model.scale;
    region.world_from_axes =
        Eigen::Quaterniond(own_from_model.rotation) * region.world_from_axes;
  }
  return positions;
}

namespace {

// Gives positions whose radius is unknown (zero) the median of the others, if
// there are others, and tells `on_note`, also of a given radius without use.
void CompleteRadii(const std::optional<double>& given, const FileNote& on_note,
                   std::vector<KnownPosition>* positions) {
  std::vector<double> known;
  bool is_used = false;
  for (const KnownPosition& position : *positions) {
    const Eigen::Vector3d& axes = position.region.semi_axes;
    if (axes.minCoeff() > 0) known.push_back(std::cbrt(axes.prod()));
    is_used |= position.region.IsBall() && axes[0] == given;
  }
  if (given && !is_used && on_note) {
    on_note(
        "--Problem.position_radius is not used: all positions have their own "
        "radii");
  }
  const size_t num_without = positions->size() - known.size();
  if (known.empty() || num_without == 0) return;
  const double radius = Median(std::move(known));
  for (KnownPosition& position : *positions) {
    Ellipsoid& region = position.region;
    if (!(region.semi_axes.minCoeff() > 0))
      region.semi_axes.setConstant(radius);
  }
  if (!on_note) return;
  std::ostringstream text;
  text << num_without << " of " << positions->size()
       << " positions have no radius or covariance that can be used: they take "
          "the median of the others' radii, "
       << radius;
  on_note(text.str());
}

}  // namespace

KnownPositions ReadKnownPositions(const PositionFiles& files,
                                  const Model& model, const FileNote& on_note) {
  const PositionsOptions options{files.radius, on_note, files.have_own_frame};
  KnownPositions known;
  if (!files.of_cameras.empty()) {
    const FileBytes file = ReadFileBytes(files.of_cameras);
    known.positions = options.has_own_frame && IsDatabase(file)
                          ? ReadPosePriors(files.of_cameras, model, options)
                          : ReadPositions(file, model, options);
  }
  if (!files.of_points.empty()) {
    const std::vector<KnownPosition> of_points =
        ReadPointPositions(ReadFileBytes(files.of_points), model, options);
    known.positions.insert(known.positions.end(), of_points.begin(),
                           of_points.end());
  }
  CompleteRadii(files.radius, on_note, &known.positions);
  if (!options.has_own_frame) return known;
  known.frame = FindPositionFrame(
      model, known.positions,
      files.of_cameras.empty() ? files.of_points : files.of_cameras);
  known.positions = known.frame->positions;
  return known;
}

}  // namespace krot::internal
