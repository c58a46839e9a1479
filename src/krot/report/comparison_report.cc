#include <cmath>
#include <iomanip>
#include <sstream>

#include "krot/base/numbers.h"
#include "krot/report/report_json.h"
#include "krot/report/reports.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

std::string FormatAngle(double degrees) { return FormatNumber(degrees, 6); }

// Per cent of the scene's radius; "-" if that is zero.
std::string FormatShare(double length, double scene_radius) {
  return scene_radius > 0 ? FormatNumber(100 * length / scene_radius, 4) : "-";
}

std::string CountTable(const ComparisonSummary& summary) {
  TextTable table(
      {"", "model 1", "model 2", "in both", "only in 1", "only in 2"});
  const auto add = [&](const std::string& name, int64_t ModelCounts::*count) {
    const int64_t shared = summary.shared.*count;
    table.AddRow({name, summary.model1.*count, summary.model2.*count, shared,
                  summary.model1.*count - shared,
                  summary.model2.*count - shared});
  };
  add("images", &ModelCounts::num_images);
  add("points", &ModelCounts::num_points);
  add("observations", &ModelCounts::num_observations);
  const int64_t num_without_pose =
      summary.shared.num_images - summary.num_shared_poses;
  std::string text = "What the models hold\n" + table.ToString();
  if (num_without_pose > 0) {
    text += std::to_string(num_without_pose) +
            " of the images in both have no pose in one of them.\n";
  }
  return text;
}

std::string AlignmentSentence(const ComparisonSummary& summary) {
  if (summary.alignment == AlignmentKind::kNone) {
    return "as stored, not aligned";
  }
  const Similarity& similarity = summary.world1_from_world2;
  const double angle_deg =
      AngleDeg(similarity.rotation, Eigen::Matrix3d::Identity());
  const std::string means =
      summary.alignment == AlignmentKind::kFrame
          ? "after giving model 2 the frame of model 1"
          : "after the similarity that fits the camera centres";
  return means + "\n(model 2 scaled by " + FormatNumber(similarity.scale, 8) +
         ", turned by " + FormatNumber(angle_deg, 6) + " degrees, moved by " +
         FormatLength(summary.moved) + ")";
}

template <typename Format>
Row DifferenceRow(const std::string& name,
                  const DifferenceStatistics& differences,
                  const Format& format) {
  if (differences.count == 0) return {name, "0", "-", "-", "-", "-"};
  return {name,
          differences.count,
          format(differences.max),
          format(differences.median),
          format(differences.mean),
          format(differences.rms)};
}

std::string DifferenceTable(const ComparisonSummary& summary) {
  const auto share = [&summary](double length) {
    return FormatShare(length, summary.scene_radius);
  };
  TextTable table({"", "count", "max", "median", "mean", "RMS"});
  const auto add = [&](const char* name, const auto& of, const auto& format) {
    table.AddRow(DifferenceRow(name, of, format));
  };
  add("rotations, degrees", summary.rotation_deg, FormatAngle);
  add("centres, scene units", summary.center, FormatLength);
  add("centres, % of the radius", summary.center, share);
  add("points, scene units", summary.point, FormatLength);
  add("points, % of the radius", summary.point, share);
  return "\nHow far cameras and points are apart, " +
         AlignmentSentence(summary) + "\n" + table.ToString() +
         "The cameras' radius, RMS about their centroid, is " +
         FormatLength(summary.scene_radius) + " scene units.\n";
}

std::string ComparedErrorTable(const ComparisonSummary& summary) {
  TextTable table(ErrorHead(""));
  table.AddRow(ErrorRow("model 1", summary.errors1));
  table.AddRow(ErrorRow("model 2", summary.errors2));
  table.AddRow(ErrorRow("model 1, those in both", summary.shared_errors1));
  table.AddRow(ErrorRow("model 2, those in both", summary.shared_errors2));
  std::string text = "\nTrue reprojection errors, pixels\n" + table.ToString();
  const int64_t not_finite1 = summary.errors1.not_finite;
  const int64_t not_finite2 = summary.errors2.not_finite;
  if (not_finite1 + not_finite2 > 0) {
    text += std::to_string(not_finite1) + " more observations of model 1 and " +
            std::to_string(not_finite2) + " of model 2 have no finite error.\n";
  }
  return text;
}

std::string FormatMax(const PixelErrorStatistics& errors) {
  return errors.count > 0 ? FormatNumber(errors.max, 4) : "-";
}

// The images with the largest key, descending; those whose key is not positive
// are not listed.
template <typename Key>
std::string ImageTable(const std::string& title,
                       const ComparisonSummary& summary, size_t max_rows,
                       const Key& key) {
  auto images = PointersIf(summary.images, [&](const ImageDifference& image) {
    return key(image) > 0;
  });
  SortLargestFirst(&images, [&](const auto* image) { return key(*image); });
  return TitledTable(title,
                     {"image", "degrees", "centre", "% of the radius",
                      "max 1, px", "max 2, px"},
                     images, max_rows,
                     [&](const ImageDifference* image) -> Row {
                       const PoseDifference pose =
                           image->pose.value_or(PoseDifference{kNaN, kNaN});
                       return {image->image_name,
                               FormatAngle(pose.rotation_deg),
                               FormatLength(pose.center),
                               FormatShare(pose.center, summary.scene_radius),
                               FormatMax(image->errors1),
                               FormatMax(image->errors2)};
                     });
}

double DistanceMoved(const ImageDifference& image) {
  return image.pose ? image.pose->center : 0;
}

double MaxErrorChange(const ImageDifference& image) {
  if (image.errors1.count == 0 || image.errors2.count == 0) return 0;
  return std::abs(image.errors2.max - image.errors1.max);
}

std::string WorstPointTable(const ComparisonSummary& summary, size_t max_rows) {
  return TitledTable(
      "The points farthest apart",
      {"point3D_id 1", "point3D_id 2", "distance", "% of the radius"},
      PointersIf(
          summary.worst_points,
          [](const PointDifference& point) { return point.distance > 0; }),
      max_rows, [&](const PointDifference* point) -> Row {
        return {point->point3D_id1, point->point3D_id2,
                FormatLength(point->distance),
                FormatShare(point->distance, summary.scene_radius)};
      });
}

std::string CertificateText(const std::string& name,
                            const std::optional<CertificateVerdict>& verdict,
                            int max_rows) {
  if (!verdict) return "";
  return "\n" + name + ". " + CertificateTable(*verdict, max_rows);
}

}  // namespace

std::string ComparisonTable(const ComparisonReport& report, int max_rows) {
  const ComparisonSummary& summary = report.summary;
  const size_t num_rows = static_cast<size_t>(max_rows);
  return CountTable(summary) + DifferenceTable(summary) +
         ComparedErrorTable(summary) +
         ImageTable("The cameras farthest apart", summary, num_rows,
                    &DistanceMoved) +
         ImageTable("The images whose largest error changed most", summary,
                    num_rows, &MaxErrorChange) +
         WorstPointTable(summary, num_rows) +
         (report.distances
              ? DistanceTable(*report.distances, {"model 1", "model 2"})
              : "") +
         CertificateText("Model 1", report.certificate1, max_rows) +
         CertificateText("Model 2", report.certificate2, max_rows);
}

namespace {

Json CountJson(const ComparisonSummary& summary, int64_t ModelCounts::*count) {
  return {{"model1", summary.model1.*count},
          {"model2", summary.model2.*count},
          {"shared", summary.shared.*count}};
}

std::string AlignmentName(AlignmentKind kind) {
  using Enum = AlignmentKind;
  return NameIn<Enum>({{Enum::kNone, "none"},
                       {Enum::kFrame, "frame"},
                       {Enum::kSimilarity, "similarity"}},
                      kind);
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
  return Joined({{"count", differences.count}},
                KnownIf(differences.count > 0,
                        KROT_JSON_OF(differences, max, median, mean, rms)));
}

Json SharedImageJson(const ImageDifference& image) {
  Json json = KROT_JSON_OF(image, image_name, image_id1, image_id2);
  json.update(KROT_JSON_OF(image.pose.value_or(PoseDifference{kNaN, kNaN}),
                           rotation_deg, center));
  json["pixel_error"] = {{"model1", CountedErrorJson(image.errors1)},
                         {"model2", CountedErrorJson(image.errors2)}};
  return json;
}

Json WorstPointJson(const PointDifference& point) {
  return KROT_JSON_OF(point, point3D_id1, point3D_id2, distance);
}

}  // namespace

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
      {"images", ListJson(summary.images, SharedImageJson)},
      {"worst_points", ListJson(summary.worst_points, WorstPointJson)},
      {"distances", DistancesJson(report.distances, {"model1", "model2"})},
      {"certificate",
       {{"model1", JsonIf(report.certificate1, VerdictJson)},
        {"model2", JsonIf(report.certificate2, VerdictJson)}}},
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
