#include "krot/model/known_distances.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/model/name_list.h"
#include "krot/model/rigs.h"

namespace krot::internal {

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
  std::unordered_map<std::string_view, int32_t> image_of_name;
  for (size_t n = 0; n < other.images.size(); ++n) {
    image_of_name.emplace(other.images[n].name, static_cast<int32_t>(n));
  }
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
