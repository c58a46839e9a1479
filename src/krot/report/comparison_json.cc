#include <iomanip>
#include <sstream>

#include "krot/report/comparison_report.h"
#include "krot/report/report_json.h"

namespace krot::internal {
namespace {

Json CountJson(const ComparisonSummary& summary, int64_t ModelCounts::*count) {
  return {{"model1", summary.model1.*count},
          {"model2", summary.model2.*count},
          {"shared", summary.shared.*count}};
}

Json AlignmentJson(const ComparisonSummary& summary) {
  const Similarity& similarity = summary.world1_from_world2;
  const Eigen::Matrix3d& R = similarity.rotation;
  return {{"kind", AlignmentName(summary.alignment)},
          {"scale", similarity.scale},
          {"rotation",
           {VectorJson(R.row(0)), VectorJson(R.row(1)), VectorJson(R.row(2))}},
          {"translation", VectorJson(similarity.translation)},
          {"moved", summary.moved}};
}

Json DifferenceJson(const DifferenceStatistics& differences) {
  const auto known = [&differences](double value) {
    return differences.count > 0 ? Json(value) : Json();
  };
  return {{"count", differences.count},
          {"max", known(differences.max)},
          {"median", known(differences.median)},
          {"mean", known(differences.mean)},
          {"rms", known(differences.rms)}};
}

Json SharedImagesJson(const std::vector<ImageDifference>& images) {
  Json json = Json::array();
  for (const ImageDifference& image : images) {
    json.push_back(
        {{"image_name", image.image_name},
         {"image_id1", image.image_id1},
         {"image_id2", image.image_id2},
         {"rotation_deg", image.pose ? Json(image.pose->rotation_deg) : Json()},
         {"center", image.pose ? Json(image.pose->center) : Json()},
         {"pixel_error",
          {{"model1", CountedErrorJson(image.errors1)},
           {"model2", CountedErrorJson(image.errors2)}}}});
  }
  return json;
}

Json WorstPointsJson(const std::vector<PointDifference>& points) {
  Json json = Json::array();
  for (const PointDifference& point : points) {
    json.push_back({{"point3D_id1", point.point3D_id1},
                    {"point3D_id2", point.point3D_id2},
                    {"distance", point.distance}});
  }
  return json;
}

}  // namespace

std::string AlignmentName(AlignmentKind kind) {
  switch (kind) {
    case AlignmentKind::kNone:
      return "none";
    case AlignmentKind::kFrame:
      return "frame";
    case AlignmentKind::kSimilarity:
      return "similarity";
  }
  return "";
}

std::string ComparisonJson(const ComparisonReport& report) {
  const ComparisonSummary& summary = report.summary;
  const Json json = {
      {"version", report.version},
      {"command", "model_comparer"},
      {"num_images", CountJson(summary, &ModelCounts::num_images)},
      {"num_points", CountJson(summary, &ModelCounts::num_points)},
      {"num_observations", CountJson(summary, &ModelCounts::num_observations)},
      {"contradictions",
       {{"model1", ContradictionsJson(report.contradictions1)},
        {"model2", ContradictionsJson(report.contradictions2)}}},
      {"num_shared_poses", summary.num_shared_poses},
      {"alignment", AlignmentJson(summary)},
      {"scene_radius",
       summary.num_shared_poses > 0 ? Json(summary.scene_radius) : Json()},
      {"rotation_deg", DifferenceJson(summary.rotation_deg)},
      {"center", DifferenceJson(summary.center)},
      {"point", DifferenceJson(summary.point)},
      {"pixel_error",
       {{"model1", CountedErrorJson(summary.errors1)},
        {"model2", CountedErrorJson(summary.errors2)},
        {"shared1", CountedErrorJson(summary.shared_errors1)},
        {"shared2", CountedErrorJson(summary.shared_errors2)}}},
      {"images", SharedImagesJson(summary.images)},
      {"worst_points", WorstPointsJson(summary.worst_points)},
      {"certificate",
       {{"model1", VerdictJson(report.certificate1)},
        {"model2", VerdictJson(report.certificate2)}}},
  };
  return ReportText(json);
}

std::string PoseErrorsCsv(const ComparisonSummary& summary) {
  std::ostringstream text;
  text << "# rotation difference (deg), distance of the centres, image name\n"
       << std::setprecision(17);
  for (const ImageDifference& image : summary.images) {
    if (!image.pose) continue;
    text << image.pose->rotation_deg << ", " << image.pose->center << ", "
         << image.image_name << '\n';
  }
  return text.str();
}

}  // namespace krot::internal
