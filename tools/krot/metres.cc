#include "tools/krot/metres.h"

#include "krot/compare.h"
#include "krot/context.h"
#include "krot/model/model_io.h"
#include "krot/report/text_table.h"
#include "tools/krot/run_log.h"

namespace krot::internal {

std::optional<DistanceReport> MeasureFile(
    const std::string& path, const std::vector<const Model*>& models,
    const LogOptions& log, bool may_lack_metres) {
  if (path.empty()) return std::nullopt;
  LogInput(path);
  DistanceReport report;
  report.distances = ReadDistances(ReadFileBytes(path), *models.front(),
                                   may_lack_metres, WarnOn(log));
  for (const KnownDistance& distance : report.distances) {
    report.names.push_back(NameOf(*models.front(), distance));
  }
  for (const Model* model : models) {
    report.models.push_back(MeasureDistances(
        *model, InOtherModel(report.distances, *models.front(), *model)));
  }
  return report;
}

KnownPositions ReadKnownPositions(const ModelPaths& paths, const Model& model,
                                  const LogOptions& log) {
  for (const std::string* path :
       {&paths.positions_path, &paths.point_positions_path}) {
    if (!path->empty()) LogInput(*path);
  }
  KnownPositions known = ReadKnownPositions(
      {paths.positions_path, paths.point_positions_path,
       paths.positions_frame == "own", paths.position_radius},
      model, WarnOn(log));
  if (!known.frame) return known;
  LogLine(log, 1, PositionFrameSentence(*known.frame));
  for (const WrongPosition& wrong : known.frame->wrong) {
    LogLine(log, 0, "warning: " + WrongPositionSentence(wrong));
  }
  return known;
}

std::optional<DistanceReport> ReadKnownDistances(const ModelPaths& paths,
                                                 const Model& model,
                                                 const LogOptions& log) {
  std::optional<DistanceReport> report =
      MeasureFile(paths.distances_path, {&model}, log, false);
  if (!report) return report;
  const std::optional<DistanceScale>& scale = report->models[0].scale;
  const bool is_held =
      !paths.positions_path.empty() || !paths.point_positions_path.empty() ||
      !paths.fixed_images_path.empty() || !paths.fixed_points_path.empty();
  if (!is_held && scale) {
    RequireOneScale(paths.distances_path, report->distances.size(), *scale);
  }
  return report;
}

namespace {

// The scale that something else holds, in metres per unit; none if nothing
// does.
std::optional<double> HeldScale(const SolveReport& report) {
  if (report.position_frame) return report.position_frame->own_from_model.scale;
  const SolveSummary& summary = report.summary;
  if (summary.num_positions > 0 || summary.num_fixed_frames > 0 ||
      summary.num_fixed_points > 0) {
    return 1;
  }
  return std::nullopt;
}

}  // namespace

void MeasureSolved(const Model& solved, const LogOptions& log,
                   SolveReport* report) {
  if (!report->distances) return;
  DistanceReport& distances = *report->distances;
  const std::optional<double> held = HeldScale(*report);
  distances.models.push_back(
      MeasureDistances(solved, distances.distances, held));
  const std::optional<DistanceScale>& scale = distances.models.back().scale;
  for (const std::string& sentence : ContradictedDistances(distances)) {
    LogLine(log, 0, "warning: " + sentence);
  }
  distances.is_scale_taken = !held && scale && scale->is_unique;
  if (held || distances.is_scale_taken) return;
  LogLine(log, 0,
          std::string("warning: the scale stays as it is: ") +
              (scale ? "the distances contradict each other, and several sets "
                       "of them are the largest"
                     : "the model holds both ends of no distance"));
}

std::optional<Model> InOutputFrame(const ModelPaths& paths, const Model& solved,
                                   SolveReport* report) {
  if (paths.output_frame == "own" && report->position_frame) {
    return InPositionFrame(solved, report);
  }
  Similarity moved_from_solved;
  if (report->distances && report->distances->is_scale_taken) {
    moved_from_solved.scale = report->distances->models.back().scale->scale;
  } else {
    return std::nullopt;
  }
  Model moved = TransformModel(solved, moved_from_solved);
  report->summary.pixel_error_after = Summarize(PixelErrors(moved));
  return moved;
}

}  // namespace krot::internal
