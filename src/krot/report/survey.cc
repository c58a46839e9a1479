#include "krot/report/survey.h"

#include <cmath>
#include <utility>

#include "krot/analysis/model_comparison.h"
#include "krot/compare.h"
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

}  // namespace krot::internal
