#include <algorithm>
#include <cmath>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry.h"
#include "krot/model/rigs.h"
#include "krot/report/adjustment_figures.h"
#include "krot/report/reports.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

const char* const kPoseNames[] = {"rx", "ry", "rz", "X", "Y", "Z"};

std::string DatumSentence(const AdjustmentPrecision& precision) {
  if (precision.datum_defect == 0) {
    return precision.num_positions > 0
               ? "Datum: the known positions."
               : "Datum: what is held fixed; its standard deviations are 0.";
  }
  switch (precision.datum) {
    case AdjustmentDatum::kPoints:
      return "Datum: free network, inner constraints over all object points.";
    case AdjustmentDatum::kFirstCamera:
      return "Datum: the first camera is fixed, and the largest coordinate of "
             "its longest base.";
    case AdjustmentDatum::kCameras:
      break;
  }
  if (precision.datum_defect == 6 && precision.num_distances > 0) {
    return "Datum: free network; the mean centre and the mean rotation of all "
           "cameras have no error, and the known distances give the scale.";
  }
  return "Datum: free network; the mean centre, the mean rotation and the RMS "
         "extent of all cameras have no error.";
}

// Says why the figures are only approximate; empty if they are exact.
std::string ValiditySentence(const AdjustModelSummary& summary) {
  if (!summary.precision->is_least_squares) {
    return "A robust loss or a cap has led the adjustment: sigma0 and all "
           "standard deviations are those of plain least squares around its "
           "estimate, and only approximate.\n";
  }
  if (summary.adjustment.termination !=
      BundleAdjustmentTermination::kConverged) {
    return "The adjustment has not converged: all figures are approximate.\n";
  }
  return "";
}

// The correlations whose absolute value is above 0.95.
template <typename NameOf>
std::string CorrelationWords(const Eigen::MatrixXd& covariance,
                             const NameOf& name_of) {
  const Eigen::VectorXd sigma = Deviations(covariance);
  std::vector<std::string> words;
  for (Eigen::Index a = 0; a < sigma.size(); ++a) {
    for (Eigen::Index b = 0; b < a; ++b) {
      const double value = covariance(a, b) / (sigma[a] * sigma[b]);
      if (!(std::abs(value) > 0.95)) continue;
      words.push_back(name_of(b) + "-" + name_of(a) + " " +
                      FormatNumber(100 * value, 1) + " %");
    }
  }
  return ListText(words);
}

// The number of decimals that shows two digits of the median deviation.
int DecimalsFor(std::vector<double> sigmas) {
  sigmas.erase(std::remove_if(sigmas.begin(), sigmas.end(),
                              [](double s) { return !(s > 0 && s < 1e300); }),
               sigmas.end());
  if (sigmas.empty()) return 6;
  const double digits = 1 - std::floor(std::log10(Median(std::move(sigmas))));
  return static_cast<int>(std::clamp(digits, 0.0, 12.0));
}

// Adds a cell for each coordinate.
void Append(const Eigen::VectorXd& values, int decimals, Row* row) {
  for (const double value : values) {
    row->push_back(FormatNumber(value, decimals));
  }
}

std::string ResidualName(const NamedObservation& o) {
  return "point3D_id " + std::to_string(o.point3D_id) + " on image " +
         o.image->name + ", 2D point " + std::to_string(o.point2D_idx);
}

std::string SummarySection(const AdjustModelSummary& summary,
                           const PrecisionFigures& figures) {
  const AdjustmentPrecision& precision = *summary.precision;
  TextTable table;
  const auto row = [&](const std::string& name, const std::string& value) {
    table.AddRow({name, value});
  };
  row("images", Thousands(summary.adjustment.num_images));
  row("object points", Thousands(summary.adjustment.num_points));
  row("image points", Thousands(figures.all.size()));
  row("observations (image coordinates)", Thousands(2 * figures.all.size()));
  if (precision.num_positions > 0) {
    row("known positions", Thousands(precision.num_positions));
  }
  row("unknowns", Thousands(precision.num_unknowns));
  row("datum defect", Thousands(precision.datum_defect));
  if (precision.num_undetermined > 0) {
    row("unknowns not determined", Thousands(precision.num_undetermined));
  }
  if (precision.num_points_in_cameras > 0) {
    row("object points in a camera that sees them, left out",
        Thousands(precision.num_points_in_cameras));
  }
  row("redundancy", Thousands(precision.redundancy));
  row("sigma0 a posteriori, px", FormatNumber(precision.sigma0_px, 6));
  const auto worst = figures.LargestResiduals();
  double square = 0;
  for (const NamedObservation& o : figures.all) {
    square += o.error_px * o.error_px;
  }
  row("RMS of image points, px",
      FormatNumber(std::sqrt(square / static_cast<double>(figures.all.size())),
                   4));
  row("largest residual, px", FormatNumber(worst.at(0).error_px, 4));
  return table.ToString() + "  largest residual: " + ResidualName(worst.at(0)) +
         "\n" + DatumSentence(precision) + "\n" + ValiditySentence(summary);
}

std::string CameraSection(const AdjustmentPrecision& precision,
                          const Model& model) {
  std::string text;
  for (const CameraPrecision& one : precision.cameras) {
    const Camera& camera = model.cameras[one.camera];
    const std::vector<std::string> names = ParamNames(camera.model_id);
    text += "Camera " + std::to_string(camera.id) + ", " +
            std::string(FindCameraModel(camera.model_id)->name) + ", pixels\n";
    TextTable table({"parameter", "value", "std. dev."});
    for (size_t n = 0; n < one.params.size(); ++n) {
      const double sigma =
          one.covariance
              ? Deviations(*one.covariance)[static_cast<Eigen::Index>(n)]
              : kNaN;
      const int decimals = DecimalsFor({sigma});
      table.AddRow({names[one.params[n]],
                    FormatNumber(camera.params[one.params[n]], decimals),
                    FormatNumber(sigma, decimals)});
    }
    text += table.ToString();
    if (!one.covariance) {
      text += "  Not all of these parameters are determined.\n";
      continue;
    }
    const std::string words = CorrelationWords(
        *one.covariance, [&](Eigen::Index n) { return names[one.params[n]]; });
    text += words.empty() ? "  No correlation above 95 %.\n"
                          : "  Correlations above 95 %: " + words + ".\n";
  }
  return text;
}

std::string ImageSection(const AdjustmentPrecision& precision,
                         const Model& model) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  std::vector<double> lengths;
  for (const ImagePrecision& image : precision.images) {
    if (!image.covariance) continue;
    const Eigen::VectorXd sigma = Deviations(*image.covariance);
    lengths.insert(lengths.end(), sigma.data() + 3, sigma.data() + 6);
  }
  const int decimals = DecimalsFor(std::move(lengths));
  TextTable table({"image", "points", "rms vx", "rms vy", "max v", "X", "Y",
                   "Z", "sX", "sY", "sZ", "srx, deg", "sry, deg", "srz, deg"});
  std::string correlations;
  for (const ImagePrecision& image : precision.images) {
    Row cells = {model.images[image.image].name,
                 Thousands(image.num_observations)};
    Append(image.rms_px, 3, &cells);
    cells.push_back(FormatNumber(image.max_px, 3));
    Append(Center(geometries[image.image].cam_from_world), decimals, &cells);
    Eigen::VectorXd sigma = Eigen::VectorXd::Constant(6, kNaN);
    if (image.covariance) sigma = Deviations(*image.covariance);
    Append(sigma.tail(3), decimals, &cells);
    Append(sigma.head(3) * kDegreesPerRadian, 5, &cells);
    table.AddRow(std::move(cells));
    if (!image.covariance) continue;
    const std::string words = CorrelationWords(
        *image.covariance,
        [](Eigen::Index n) { return std::string(kPoseNames[n]); });
    if (words.empty()) continue;
    correlations += "  " + model.images[image.image].name + ": " + words + "\n";
  }
  return table.ToString() + TextIf(!correlations.empty(),
                                   "Correlations above 95 %\n" + correlations);
}

std::string ReliabilitySection(const AdjustmentPrecision& precision,
                               const PrecisionFigures& figures) {
  const double mean_r = static_cast<double>(precision.redundancy) /
                        (2 * static_cast<double>(figures.all.size()));
  TextTable table;
  table.AddRow({"mean redundancy number", FormatNumber(mean_r, 3)});
  table.AddRow({"median smallest detectable error, px",
                FormatNumber(figures.MedianDetectablePx(), 3)});
  table.AddRow({"image points not controlled in a direction",
                Thousands(figures.num_uncontrolled)});
  table.AddRow({"critical value of w", FormatNumber(figures.critical_w, 2)});
  table.AddRow({"image points above it", Thousands(figures.num_above)});
  return table.ToString() + "Image points with the largest w\n" +
         TableOf({"image", "2D point", "point3D_id", "vx", "vy", "rx", "ry",
                  "w", "detectable, px"},
                 figures.LargestW(), [&](const NamedObservation& o) {
                   Row cells = {o.image->name, o.point2D_idx, o.point3D_id};
                   Append(o.precision->residual_px, 3, &cells);
                   Append(o.precision->redundancy, 3, &cells);
                   cells.push_back(FormatNumber(o.w, 2));
                   cells.push_back(
                       FormatNumber(o.DetectablePx(precision.sigma0_px), 2));
                   return cells;
                 });
}

std::string PointSections(const AdjustmentPrecision& precision,
                          const PrecisionFigures& figures, const Model& model) {
  const auto begin_row = [&](const PointPrecision& point) -> Row {
    return {model.points3D[point.point].id, point.num_rays,
            FormatNumber(point.angle_deg, 2)};
  };
  std::string text =
      "\nRays per object point\n" +
      TableOf({"rays", "points"}, figures.num_with_rays,
              [](const auto& entry) -> Row {
                return {entry.first, Thousands(entry.second)};
              }) +
      "\nIntersection angles, mean " + FormatNumber(figures.mean_angle_deg, 1) +
      " deg; the smallest (of the two rays nearest to a right angle)\n" +
      TableOf({"point3D_id", "rays", "angle, deg"}, figures.SmallestAngles(),
              begin_row);
  std::vector<double> lengths;
  for (const PointPrecision& point : precision.points) {
    lengths.insert(lengths.end(), point.sigma.data(), point.sigma.data() + 3);
  }
  const int decimals = DecimalsFor(std::move(lengths));
  text += "\nObject points";
  if (precision.has_covariances) {
    const Vector3d rms = figures.RmsSigma();
    text += "; RMS of the standard deviations: sX " +
            FormatNumber(rms.x(), decimals) + ", sY " +
            FormatNumber(rms.y(), decimals) + ", sZ " +
            FormatNumber(rms.z(), decimals);
  }
  return text + "\n" +
         TableOf({"point3D_id", "rays", "angle, deg", "rms v, px", "X", "Y",
                  "Z", "sX", "sY", "sZ"},
                 precision.points, [&](const PointPrecision& point) {
                   Row cells = begin_row(point);
                   cells.push_back(FormatNumber(point.rms_px, 3));
                   Append(model.points3D[point.point].xyz, decimals, &cells);
                   Append(point.sigma, decimals, &cells);
                   return cells;
                 });
}

// `in_deviations`: with a column of the differences in standard deviations.
std::string SurveySection(const SurveyComparison& survey, bool in_deviations) {
  std::vector<double> lengths;
  Vector3d squares = Vector3d::Zero();
  for (const SurveyComparison::Place& place : survey.places) {
    lengths.push_back(place.difference.norm());
    squares += place.difference.cwiseAbs2();
  }
  const int decimals = DecimalsFor(std::move(lengths)) + 1;
  TextTable table;
  const auto add = [&](Row cells, const std::string& deviations) {
    if (in_deviations) cells.push_back(deviations);
    table.AddRow(std::move(cells));
  };
  add({"name", "X", "Y", "Z", "dX", "dY", "dZ", "length"}, "in sigma");
  for (const SurveyComparison::Place& place : survey.places) {
    Row cells = {place.name};
    Append(place.surveyed, decimals, &cells);
    Append(place.difference, decimals, &cells);
    cells.push_back(FormatNumber(place.difference.norm(), decimals));
    add(std::move(cells), FormatNumber(place.deviations, 1));
  }
  squares /= static_cast<double>(survey.places.size());
  Row cells = {"RMS", "", "", ""};
  Append(squares.cwiseSqrt(), decimals, &cells);
  cells.push_back(FormatNumber(survey.rms, decimals));
  add(std::move(cells), "");
  return table.ToString();
}

std::string SurveySections(const AdjustmentReport& report) {
  std::string text;
  if (report.positions) {
    text += "\nKnown positions, in their frame and unit\n" +
            SurveySection(*report.positions, true);
  }
  if (report.check_points) {
    const SurveyComparison& check = *report.check_points;
    text += "\nCheck points, in the survey's frame and unit";
    if (check.is_fitted) {
      text += ", after the similarity that fits them best (scale " +
              FormatLength(check.scale) + ")";
    }
    text += "\n" + SurveySection(check, false);
  }
  return text;
}

}  // namespace

std::string AdjustmentText(const AdjustmentReport& report, const Model& model) {
  const AdjustModelSummary& summary = report.summary;
  std::string text = "KROT " + report.run.version + ", bundle adjustment\n" +
                     AdjustmentTable(report) + SurveySections(report);
  if (!summary.precision) return text;
  const AdjustmentPrecision& precision = *summary.precision;
  const PrecisionFigures figures(precision, model);
  text += "\nPrecision\n" + SummarySection(summary, figures);
  if (!precision.has_covariances) {
    text +=
        "Standard deviations and redundancy numbers are left out: they "
        "take too long for so many images. Raise --BundleAdjustmentCeres."
        "max_num_images_direct_sparse_cpu_solver to have them.\n";
  }
  if (!precision.cameras.empty()) {
    text += "\nInterior orientation\n" + CameraSection(precision, model);
  }
  text +=
      "\nExterior orientation: centres, and rotations about the camera's "
      "own axes; v in px\n" +
      ImageSection(precision, model);
  if (precision.has_covariances) {
    text +=
        "\nReliability: redundancy numbers r, standardised residuals w "
        "(data snooping), smallest detectable errors " +
        FormatNumber(kDelta0, 2) + " sigma0 / sqrt(r)\n" +
        ReliabilitySection(precision, figures);
  }
  return text + PointSections(precision, figures, model);
}

std::string PrecisionSentence(const AdjustmentPrecision& precision) {
  return "sigma0 " + Pixels(precision.sigma0_px) +
         " a posteriori, redundancy " + Thousands(precision.redundancy) + ": " +
         Thousands(2 * static_cast<int64_t>(precision.observations.size()) +
                   3 * precision.num_positions) +
         " observed coordinates" +
         TextIf(precision.num_distances > 0,
                " and " + Counted(precision.num_distances, "distance")) +
         ", " + Counted(precision.num_unknowns, "unknown") + ", datum defect " +
         std::to_string(precision.datum_defect) + ".";
}

}  // namespace krot::internal
