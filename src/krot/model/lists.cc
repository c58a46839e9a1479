#include "krot/model/model_io.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/context.h"
#include "krot/model/name_list.h"
#include "krot/model/rigs.h"

namespace krot::internal {

std::vector<char> FixedFrames(const FileBytes& file, const Model& model,
                              const FileNote& note) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  ListReader list(file, model, ListReader::Of::kImagesOrIds);
  std::vector<char> is_fixed(model.frames.size(), 0);
  while (list.Next()) {
    const std::optional<int32_t> image = list.TakeName();
    if (!image) continue;
    if (!geometries[*image].has_pose) {
      list.reader().Fail("\"" + model.images[*image].name +
                             "\", which stands nowhere in the model",
                         "an image with a pose");
    }
    is_fixed[geometries[*image].frame] = 1;
  }
  list.Finish(note);
  return is_fixed;
}

std::vector<char> FixedPoints3D(const FileBytes& file, const Model& model,
                                const FileNote& note) {
  ListReader list(file, model, ListReader::Of::kPoints3D);
  std::vector<char> is_fixed(model.points3D.size(), 0);
  while (list.Next()) {
    if (const auto point = list.TakeName()) is_fixed[*point] = 1;
  }
  list.Finish(note);
  return is_fixed;
}

namespace {

using Eigen::Vector3d;

// How many numbers a line may have behind the name: position, semi-axes and
// quaternion; position and semi-axes; position and radius; or a position alone.
const std::vector<size_t> kCounts = {10, 6, 4, 3};
constexpr char kExpected[] =
    "X Y Z RADIUS, or X Y Z and three semi-axes, or these and QW QX QY QZ";

[[noreturn]] void FailWithoutRadius(const TextReader& reader) {
  reader.Fail("no RADIUS behind X Y Z",
              std::string(kExpected) +
                  "; --Problem.position_radius gives one to all such lines");
}

Ellipsoid RegionOf(const std::vector<double>& v,
                   const std::optional<double>& radius,
                   const TextReader& reader) {
  if (v.size() == 3 && !radius) FailWithoutRadius(reader);
  Ellipsoid region =
      BallAround({v[0], v[1], v[2]}, v.size() == 3 ? *radius : v[3]);
  if (v.size() >= 6) region.semi_axes = {v[3], v[4], v[5]};
  if (v.size() == 10) region.world_from_axes = {v[6], v[7], v[8], v[9]};
  if (!(region.semi_axes.minCoeff() > 0)) {
    std::string found = "\"";
    AppendNumber(region.semi_axes.minCoeff(), &found);
    reader.Fail(found + "\"", "a radius above zero");
  }
  if (!IsFit(region)) {
    reader.Fail("semi-axes or a quaternion out of range",
                "axes of which none is 10,000 times another, and a quaternion "
                "that is not zero");
  }
  return region;
}

// The distance between the quartiles of a coordinate, which a few outliers do
// not change.
double Spread(std::vector<Vector3d> positions, int axis) {
  if (positions.empty()) return 0;
  std::sort(positions.begin(), positions.end(),
            [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
  const size_t count = positions.size();
  return positions[3 * count / 4][axis] - positions[count / 4][axis];
}

// Whether x and y are latitude and longitude in degrees rather than lengths.
// They are if they are in the range of degrees and their spread is tiny: beside
// their distance from zero, and beside the spread of the same cameras or points
// in the model (or, if the model has no positions, that of the heights). A
// degree is 111 km, so in metres the spread would be 10^5 times as large.
bool AreDegrees(const std::vector<Vector3d>& positions,
                const std::vector<Vector3d>& in_model) {
  Vector3d farthest = Vector3d::Zero();
  for (const Vector3d& x : positions)
    farthest = farthest.cwiseMax(x.cwiseAbs());
  const double larger = std::max(farthest.x(), farthest.y());
  if (larger > 180 || std::min(farthest.x(), farthest.y()) > 90) return false;
  const double spread = std::max(Spread(positions, 0), Spread(positions, 1));
  double other = 0;
  for (int axis = 0; axis < 3; ++axis) {
    other = std::max(other, Spread(in_model, axis));
  }
  if (other == 0) other = Spread(positions, 2);
  return spread > 0 && spread < 0.01 * std::min(larger, other);
}

bool NamesDegrees(std::string header) {
  for (char& c : header) {
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return header.find("lat") != std::string::npos &&
         (header.find("lon") != std::string::npos ||
          header.find("lng") != std::string::npos);
}

// Reads the list; `in_model` are the model's own positions, NaN for none.
std::vector<KnownPosition> ReadList(const FileBytes& file, const Model& model,
                                    KnownPosition::Of of,
                                    const std::vector<Vector3d>& in_model,
                                    const PositionsOptions& options) {
  ListReader list(file, model,
                  of == KnownPosition::Of::kImage ? ListReader::Of::kImages
                                                  : ListReader::Of::kPoints3D);
  std::vector<std::pair<ListReader::Line, TextReader>> lines;
  std::vector<Vector3d> listed;
  std::vector<Vector3d> own;
  while (list.Next()) {
    const auto line = list.Take(kCounts, kExpected);
    if (!line) continue;
    lines.emplace_back(*line, list.reader());
    listed.emplace_back(line->numbers.data());
    const Vector3d& place = in_model[line->index];
    if (!options.has_own_frame && place.allFinite()) own.push_back(place);
  }
  if (NamesDegrees(list.header()) || AreDegrees(listed, own)) {
    throw ModelError(
        file.path + ": found latitudes and longitudes, expected X Y Z " +
        (options.has_own_frame
             ? "in metres; tools/scripts/geodetic_to_positions.sh makes these "
               "of them"
             : "in the model's frame and unit; "
               "tools/scripts/geodetic_to_positions.sh makes metres of them, "
               "for --positions_frame own"));
  }
  list.Finish(options.on_note);
  const auto has_radius = [&](const auto& line) {
    return line.first.numbers.size() > 3 || options.radius.has_value();
  };
  const bool may_lack_radii =
      options.has_own_frame &&
      std::none_of(lines.begin(), lines.end(), has_radius);
  std::vector<KnownPosition> positions;
  for (const auto& [line, reader] : lines) {
    positions.push_back({of, line.index,
                         may_lack_radii
                             ? BallAround(Vector3d(line.numbers.data()), 0)
                             : RegionOf(line.numbers, options.radius, reader)});
  }
  return positions;
}

}  // namespace

bool IsFit(const Ellipsoid& region) {
  const double norm = region.world_from_axes.norm();
  return region.centre.allFinite() && region.semi_axes.allFinite() &&
         region.semi_axes.minCoeff() > 0 &&
         region.semi_axes.maxCoeff() <= 1e4 * region.semi_axes.minCoeff() &&
         std::isfinite(norm) && norm > 0;
}

std::vector<KnownPosition> ReadPositions(const FileBytes& file,
                                         const Model& model,
                                         const PositionsOptions& options) {
  std::vector<Vector3d> centres;
  for (const ImageGeometry& image : ImageGeometries(model)) {
    centres.push_back(image.has_pose ? Center(image.cam_from_world)
                                     : Vector3d::Constant(kNaN));
  }
  return ReadList(file, model, KnownPosition::Of::kImage, centres, options);
}

std::vector<KnownPosition> ReadPointPositions(const FileBytes& file,
                                              const Model& model,
                                              const PositionsOptions& options) {
  std::vector<Vector3d> points;
  for (const Point3D& point : model.points3D) points.push_back(point.xyz);
  return ReadList(file, model, KnownPosition::Of::kPoint3D, points, options);
}

std::string NameOf(const Model& model, const KnownDistance& distance) {
  const auto name = [&](const KnownDistance::End& end) {
    return end.is_image
               ? model.images[end.index].name
               : "3D point " + std::to_string(model.points3D[end.index].id);
  };
  return name(distance.ends[0]) + " to " + name(distance.ends[1]);
}

std::vector<KnownDistance> ReadDistances(const FileBytes& file,
                                         const Model& model,
                                         bool may_lack_metres,
                                         const FileNote& note) {
  const std::string expected =
      std::string("two images or two 3D points, ") +
      (may_lack_metres ? "and METRES TOLERANCE where the distance is known"
                       : "METRES and TOLERANCE");
  ListReader list(file, model, ListReader::Of::kPairs);
  std::vector<KnownDistance> distances;
  while (list.Next()) {
    const auto line = list.TakePair(2, may_lack_metres, expected);
    if (!line) continue;
    KnownDistance distance;
    distance.ends = line->ends;
    if (!line->numbers.empty()) {
      for (const double number : line->numbers) {
        if (number >= 1e-12 && number <= 1e12) continue;
        std::string text = "\"";
        AppendNumber(number, &text);
        list.reader().Fail(text + "\"",
                           "METRES and TOLERANCE from 1e-12 to 1e12");
      }
      distance.metres = line->numbers[0];
      distance.tolerance = line->numbers[1];
    }
    distances.push_back(distance);
  }
  list.Finish(note);
  return distances;
}

std::vector<KnownDistance> InOtherModel(std::vector<KnownDistance> distances,
                                        const Model& model,
                                        const Model& other) {
  const auto image_of_name = ImagesByName(other);
  const IdIndex<Point3DId> points(other.points3D);
  for (KnownDistance& distance : distances) {
    for (KnownDistance::End& end : distance.ends) {
      if (end.is_image) {
        const auto found = image_of_name.find(model.images[end.index].name);
        end.index = found == image_of_name.end() ? -1 : found->second;
      } else {
        end.index = points.Find(model.points3D[end.index].id).value_or(-1);
      }
    }
  }
  return distances;
}

std::vector<double> LengthsOf(const Model& model,
                              const std::vector<KnownDistance>& distances) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const auto place = [&](const KnownDistance::End& end) -> Eigen::Vector3d {
    if (end.index < 0) return Eigen::Vector3d::Constant(kNaN);
    if (!end.is_image) return model.points3D[end.index].xyz;
    const ImageGeometry& image = geometries[end.index];
    return image.has_pose ? Center(image.cam_from_world)
                          : Eigen::Vector3d::Constant(kNaN);
  };
  std::vector<double> lengths;
  for (const KnownDistance& distance : distances) {
    lengths.push_back(
        (place(distance.ends[1]) - place(distance.ends[0])).norm());
  }
  return lengths;
}

void RequireOneScale(const std::string& where, size_t count,
                     const DistanceScale& scale) {
  if (scale.is_unique) return;
  throw ModelError(
      where + ": found " + std::to_string(count) +
      " distances that contradict each other, and several largest sets (of " +
      std::to_string(scale.num_agreeing) +
      ") that agree on a scale, expected one; take out what is wrong, or raise "
      "tolerances");
}

MeasuredDistances MeasureDistances(const Model& model,
                                   const std::vector<KnownDistance>& distances,
                                   std::optional<double> scale) {
  MeasuredDistances measured;
  measured.lengths = LengthsOf(model, distances);
  if (!scale) {
    measured.scale = FindScale(measured.lengths, distances);
    return measured;
  }
  DistanceScale known;
  known.scale = known.lowest = known.highest = *scale;
  for (size_t n = 0; n < distances.size(); ++n) {
    const double off =
        *scale * measured.lengths[n] - distances[n].metres.value_or(kNaN);
    known.agrees.push_back(std::abs(off) <= distances[n].tolerance ? 1 : 0);
    known.num_agreeing += known.agrees.back();
  }
  measured.scale = std::move(known);
  return measured;
}

std::optional<DistanceScale> FindScale(
    const std::vector<double>& lengths,
    const std::vector<KnownDistance>& distances) {
  const size_t count = distances.size();
  const auto is_usable = [&](size_t n) {
    return distances[n].metres && lengths[n] > 0 && std::isfinite(lengths[n]);
  };
  const auto end = [&](size_t n, double sign) {
    return (*distances[n].metres + sign * distances[n].tolerance) / lengths[n];
  };
  std::optional<DistanceScale> best;
  double best_sum = 0;
  // The largest set of intervals that share a point is found at the beginning
  // of one of them.
  for (size_t first = 0; first < count; ++first) {
    if (!is_usable(first)) continue;
    const double at = end(first, -1);
    DistanceScale found;
    found.agrees.assign(count, 0);
    found.lowest = at;
    found.highest = kInfinity;
    double product = 0;
    double square = 0;
    for (size_t n = 0; n < count; ++n) {
      if (!is_usable(n) || end(n, -1) > at || end(n, 1) < at) continue;
      found.agrees[n] = 1;
      ++found.num_agreeing;
      found.highest = std::min(found.highest, end(n, 1));
      const double length = lengths[n] / distances[n].tolerance;
      product += length * *distances[n].metres / distances[n].tolerance;
      square += length * length;
    }
    found.scale =
        std::min(std::max(product / square, found.lowest), found.highest);
    double sum = 0;
    for (size_t n = 0; n < count; ++n) {
      if (found.agrees[n] == 0) continue;
      const double off = (found.scale * lengths[n] - *distances[n].metres) /
                         distances[n].tolerance;
      sum += off * off;
    }
    if (best && found.num_agreeing == best->num_agreeing) {
      if (found.agrees == best->agrees) continue;
      best->is_unique = found.is_unique = false;
    }
    if (best &&
        (found.num_agreeing < best->num_agreeing ||
         (found.num_agreeing == best->num_agreeing && !(sum < best_sum)))) {
      continue;
    }
    best_sum = sum;
    best = std::move(found);
  }
  return best;
}

}  // namespace krot::internal
