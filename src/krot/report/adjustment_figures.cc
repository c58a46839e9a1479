#include "krot/report/adjustment_figures.h"

#include <cmath>
#include <optional>
#include <sstream>
#include <utility>

#include "krot/analysis/model_comparison.h"
#include "krot/analysis/noise.h"
#include "krot/camera/camera_model.h"
#include "krot/compare.h"
#include "krot/geometry.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "krot/report/report_json.h"

namespace krot::internal {

using Eigen::Vector3d;

PrecisionFigures::PrecisionFigures(const AdjustmentPrecision& precision,
                                   const Model& model)
    : precision_(precision) {
  for (const PointPrecision& point : precision.points) {
    const Point3D& of = model.points3D[point.point];
    for (int n = 0; n < point.num_rays; ++n) {
      const ObservationPrecision& o = precision.observations[all.size()];
      const TrackElement& element = model.track_elements[o.element];
      all.push_back({&o, &model.images[o.image], element.point2D_idx, of.id,
                     o.residual_px.norm(),
                     StandardizedError(o.chi2, o.num_controlled)});
    }
    num_with_rays[point.num_rays]++;
    mean_angle_deg +=
        point.angle_deg / static_cast<double>(precision.points.size());
  }
  for (const NamedObservation& o : all) {
    num_tested += o.precision->num_controlled > 0;
    num_uncontrolled += o.precision->num_controlled < 2;
  }
  if (num_tested > 0) {
    critical_w = CriticalW(num_tested, NoiseOptions().false_alarm,
                           static_cast<double>(precision.redundancy));
  }
  for (const NamedObservation& o : all) num_above += o.w > critical_w;
}

template <typename Key>
std::vector<NamedObservation> PrecisionFigures::Worst(const Key& key) const {
  std::vector<NamedObservation> worst;
  for (const NamedObservation& o : all) {
    if (!std::isnan(key(o))) worst.push_back(o);
  }
  const auto count = std::min(worst.size(), kWorstRows);
  std::partial_sort(
      worst.begin(), worst.begin() + static_cast<std::ptrdiff_t>(count),
      worst.end(),
      [&](const auto& a, const auto& b) { return key(a) > key(b); });
  worst.resize(count);
  return worst;
}

std::vector<NamedObservation> PrecisionFigures::LargestResiduals() const {
  return Worst([](const NamedObservation& o) { return o.error_px; });
}

std::vector<NamedObservation> PrecisionFigures::LargestW() const {
  return Worst([](const NamedObservation& o) { return o.w; });
}

std::vector<PointPrecision> PrecisionFigures::SmallestAngles() const {
  std::vector<PointPrecision> points = precision_.points;
  std::stable_sort(
      points.begin(), points.end(),
      [](const auto& a, const auto& b) { return a.angle_deg < b.angle_deg; });
  points.resize(std::min(points.size(), kWorstRows));
  return points;
}

Vector3d PrecisionFigures::RmsSigma() const {
  Vector3d sum = Vector3d::Zero();
  int64_t count = 0;
  for (const PointPrecision& point : precision_.points) {
    if (!point.sigma.allFinite()) continue;
    sum += point.sigma.cwiseAbs2();
    ++count;
  }
  return (sum / static_cast<double>(count)).cwiseSqrt();
}

double PrecisionFigures::MedianDetectablePx() const {
  std::vector<double> values;
  for (const NamedObservation& o : all) {
    values.push_back(o.DetectablePx(precision_.sigma0_px));
  }
  return values.empty() ? kNaN : LowerMedian(std::move(values));
}

Eigen::VectorXd Deviations(const Eigen::MatrixXd& covariance) {
  return covariance.diagonal().cwiseMax(0).cwiseSqrt();
}

std::vector<std::string> ParamNames(int model_id) {
  std::istringstream names(std::string(FindCameraModel(model_id)->param_names));
  std::vector<std::string> list;
  for (std::string name; std::getline(names >> std::ws, name, ',');) {
    list.push_back(name);
  }
  return list;
}

namespace {

std::string DatumName(AdjustmentDatum datum) {
  using Enum = AdjustmentDatum;
  return NameIn<Enum>({{Enum::kCameras, "cameras"},
                       {Enum::kPoints, "points"},
                       {Enum::kFirstCamera, "first_camera"}},
                      datum);
}

Json NumbersJson(const Eigen::VectorXd& values) {
  return ListJson(values, [](double value) { return value; });
}

// The rows of a matrix; null if it is not known.
template <typename Matrix>
Json CovarianceJson(const std::optional<Matrix>& covariance) {
  if (!covariance) return nullptr;
  return ListJson(covariance->rowwise(), NumbersJson);
}

Json ObservationsJson(const std::vector<NamedObservation>& observations,
                      double sigma0_px) {
  return ListJson(observations, [&](const NamedObservation& o) -> Json {
    return {{"image_id", o.image->id},
            {"image_name", o.image->name},
            {"point2D_idx", o.point2D_idx},
            {"point3D_id", o.point3D_id},
            {"residual", NumbersJson(o.precision->residual_px)},
            {"error", o.error_px},
            {"redundancy", NumbersJson(o.precision->redundancy)},
            {"w", o.w},
            {"smallest_detectable_error", o.DetectablePx(sigma0_px)}};
  });
}

}  // namespace

nlohmann::ordered_json SurveyJson(const std::optional<SurveyComparison>& survey,
                                  bool are_points) {
  if (!survey) return nullptr;
  Json places = ListJson(survey->places, [&](const auto& place) {
    Json json = are_points ? Json{{"point3D_id", place.point3D_id}}
                           : Json{{"name", place.name}};
    json["surveyed"] = VectorJson(place.surveyed);
    json["difference"] = VectorJson(place.difference);
    if (!are_points) json["deviations"] = place.deviations;
    return json;
  });
  return {{"scale", survey->scale}, {"rms", survey->rms}, {"points", places}};
}

nlohmann::ordered_json PrecisionJson(const AdjustmentPrecision& precision,
                                     const Model& model) {
  const PrecisionFigures figures(precision, model);
  const auto of_camera = [&](const CameraPrecision& one) -> Json {
    const Camera& camera = model.cameras[one.camera];
    const std::vector<std::string> names = ParamNames(camera.model_id);
    return {{"camera_id", camera.id},
            {"params", ListJson(one.params, [&](int n) { return names[n]; })},
            {"values",
             ListJson(one.params, [&](int n) { return camera.params[n]; })},
            {"covariance", CovarianceJson(one.covariance)}};
  };
  const auto of_image = [&](const ImagePrecision& one) -> Json {
    return {{"image_id", model.images[one.image].id},
            {"name", model.images[one.image].name},
            {"num_observations", one.num_observations},
            {"rms", NumbersJson(one.rms_px)},
            {"max", one.max_px},
            {"covariance", CovarianceJson(one.covariance)}};
  };
  const auto of_angle = [&](const PointPrecision& point) {
    return Joined({{"point3D_id", model.points3D[point.point].id}},
                  KROT_JSON_OF(point, num_rays, angle_deg));
  };
  Json json = {{"is_least_squares", precision.is_least_squares},
               {"datum", DatumName(precision.datum)}};
  json.update(KROT_JSON_OF(precision, num_unknowns, datum_defect,
                           num_undetermined, num_points_in_cameras,
                           redundancy));
  json["sigma0"] = precision.sigma0_px;
  json["cameras"] = ListJson(precision.cameras, of_camera);
  json["images"] = ListJson(precision.images, of_image);
  Json& rays = json["rays"] = Json::object();
  for (const auto& [num_rays, num_points] : figures.num_with_rays) {
    rays[std::to_string(num_rays)] = num_points;
  }
  json["mean_angle_deg"] = figures.mean_angle_deg;
  json["smallest_angles"] = ListJson(figures.SmallestAngles(), of_angle);
  json["points_sigma_rms"] = NumbersJson(figures.RmsSigma());
  json["median_smallest_detectable_error"] = figures.MedianDetectablePx();
  json.update(KROT_JSON_OF(figures, num_uncontrolled, critical_w, num_above));
  json["largest_residuals"] =
      ObservationsJson(figures.LargestResiduals(), precision.sigma0_px);
  json["largest_w"] = ObservationsJson(figures.LargestW(), precision.sigma0_px);
  return json;
}

std::optional<SurveyComparison> CompareWithSurvey(
    const Model& model, const std::vector<KnownPosition>& surveyed,
    const std::optional<Similarity>& survey_from_model) {
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  SurveyComparison survey;
  std::vector<PosePair> pairs;
  std::vector<Eigen::Matrix3d> deviations_of;  // of differences
  for (const KnownPosition& position : surveyed) {
    const auto in_model = PlaceOf(model, images, position);
    if (!in_model) continue;
    PosePair pair;
    pair.center1 = position.region.centre;
    pair.center2 = *in_model;
    SurveyComparison::Place& place = survey.places.emplace_back();
    place.name = NameOf(model, position);
    if (position.of == KnownPosition::Of::kPoint3D) {
      place.point3D_id = model.points3D[position.index].id;
    }
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
