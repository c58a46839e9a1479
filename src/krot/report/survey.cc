#include "krot/report/survey.h"

#include <cmath>
#include <utility>

#include "krot/analysis/model_comparison.h"
#include "krot/compare.h"
#include "krot/model/known_distances.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"

namespace krot::internal {

std::optional<SurveyComparison> CompareWithSurvey(
    const Model& model, const std::vector<KnownPosition>& surveyed,
    const std::optional<Similarity>& survey_from_model) {
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  SurveyComparison survey;
  std::vector<PosePair> pairs;
  std::vector<Eigen::Matrix3d> deviations_of;  // of differences
  for (const KnownPosition& position : surveyed) {
    PosePair pair;
    pair.center1 = position.region.centre;
    SurveyComparison::Place place;
    place.name = NameOf(model, position);
    if (position.of == KnownPosition::Of::kPoint3D) {
      const Point3D& point = model.points3D[position.index];
      pair.center2 = point.xyz;
      place.point3D_id = point.id;
    } else if (images[position.index].has_pose) {
      pair.center2 = Center(images[position.index].cam_from_world);
    } else {
      continue;
    }
    survey.places.push_back(std::move(place));
    pairs.push_back(pair);
    deviations_of.push_back(kRegionSigmas * position.region.UnitFromWorld());
  }
  std::optional<Similarity> similarity = survey_from_model;
  survey.is_fitted = !similarity;
  if (!similarity) similarity = AlignCenters(pairs);
  if (!similarity || pairs.empty()) return std::nullopt;
  survey.scale = similarity->scale;
  double sum = 0;
  for (size_t n = 0; n < pairs.size(); ++n) {
    SurveyComparison::Place& place = survey.places[n];
    place.surveyed = pairs[n].center1;
    place.difference = *similarity * pairs[n].center2 - place.surveyed;
    place.deviations = (deviations_of[n] * place.difference).norm();
    sum += place.difference.squaredNorm();
  }
  survey.rms = std::sqrt(sum / static_cast<double>(pairs.size()));
  return survey;
}

Survey::Survey(KnownPositions known, bool in_own_frame, Model* model)
    : positions_(std::move(known.positions)), frame_(std::move(known.frame)) {
  surveyed_ = positions_;
  if (!frame_) return;
  surveyed_ = InOwnFrame(*frame_);
  is_in_own_frame_ = in_own_frame;
  if (in_own_frame) {
    *model = TransformModel(*model, frame_->own_from_model);
    positions_ = surveyed_;
  } else {
    survey_from_model_ = frame_->own_from_model;
  }
}

std::optional<SurveyComparison> Survey::ComparePositions(
    const Model& adjusted) const {
  if (surveyed_.empty()) return std::nullopt;
  return CompareWithSurvey(adjusted, surveyed_, survey_from_model_);
}

std::optional<SurveyComparison> Survey::CompareCheckPoints(
    const Model& adjusted,
    const std::vector<KnownPosition>& check_points) const {
  if (check_points.empty()) return std::nullopt;
  if (surveyed_.empty()) return CompareWithSurvey(adjusted, check_points);
  return CompareWithSurvey(adjusted, check_points, survey_from_model_);
}

DistanceSurvey::DistanceSurvey(std::vector<KnownDistance> distances,
                               std::optional<double> held_metres_per_unit,
                               Model* model)
    : distances_(std::move(distances)) {
  const std::vector<double> lengths = LengthsOf(*model, distances_);
  std::vector<double> scales;
  for (size_t n = 0; n < lengths.size(); ++n) {
    const double scale = distances_[n].metres.value_or(kNaN) / lengths[n];
    if (std::isfinite(scale)) scales.push_back(scale);
  }
  is_metric_ = held_metres_per_unit || !scales.empty();
  if (held_metres_per_unit) {
    metres_per_unit_ = *held_metres_per_unit;
    for (KnownDistance& distance : distances_) {
      if (!distance.metres) continue;
      *distance.metres /= metres_per_unit_;
      distance.tolerance /= metres_per_unit_;
    }
  } else if (!scales.empty()) {
    scaled_by_ = Median(std::move(scales));
    Similarity scaled;
    scaled.scale = *scaled_by_;
    *model = TransformModel(*model, scaled);
  }
}

std::optional<DistanceComparison> DistanceSurvey::Compare(
    const Model& adjusted, const AdjustModelSummary& summary) const {
  if (distances_.empty()) return std::nullopt;
  DistanceComparison comparison;
  comparison.is_metric = is_metric_;
  comparison.metres_per_unit = scaled_by_;
  const std::vector<double> lengths = LengthsOf(adjusted, distances_);
  for (size_t n = 0; n < lengths.size(); ++n) {
    const KnownDistance& known = distances_[n];
    DistanceComparison::Distance distance;
    distance.name = NameOf(adjusted, known);
    if (known.metres) distance.metres = *known.metres * metres_per_unit_;
    distance.tolerance = known.tolerance * metres_per_unit_;
    distance.is_wrong = summary.is_wrong_distance[n] != 0;
    distance.length = lengths[n] * metres_per_unit_;
    comparison.distances.push_back(std::move(distance));
  }
  for (const int32_t n : summary.adjustment.distances) {
    comparison.distances[n].takes_part = true;
  }
  if (!summary.precision) return comparison;
  for (const DistancePrecision& of : summary.precision->distances) {
    DistanceComparison::Distance& distance = comparison.distances[of.distance];
    distance.sigma = of.sigma * metres_per_unit_;
    distance.redundancy = of.redundancy;
    distance.w = of.w;
  }
  return comparison;
}

}  // namespace krot::internal
