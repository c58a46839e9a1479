#include <array>
#include <cmath>
#include <string>
#include <unordered_map>
#include <vector>

#include "krot/base/context.h"
#include "krot/database.h"
#include "krot/options/command_options.h"
#include "krot/outliers/match_tracks.h"
#include "krot/report/reports.h"
#include "krot/report/text_table.h"
#include "tools/krot/command.h"
#include "tools/krot/interrupt.h"
#include "tools/krot/photo.h"
#include "tools/krot/report_files.h"
#include "tools/krot/solve_command.h"

namespace krot::internal {
namespace {

// COLMAP's own use of the command: points from the matches of a database.
struct MatchesCommand {
  std::string database_path;
  std::string image_path;
  bool clear_points = false;
  MatchTracksOptions options;
};

void AddMatchesOptions(MatchesCommand* command, OptionParser* parser) {
  parser->AddPath("database_path", &command->database_path, false, "a file",
                  "As COLMAP's command: make the points anew, from the "
                  "verified matches of this database");
  parser->AddPath("image_path", &command->image_path, false, "a folder",
                  "With database_path: the photos, for the points' colours");
  parser->AddBool("clear_points", &command->clear_points,
                  "With database_path: leave out the model's own tracks; "
                  "else they count as matches");
  parser->AddReal("Mapper.filter_max_reproj_error",
                  &command->options.max_error_px, Above(0.0, "pixels"),
                  "With database_path: the bound for every observation");
  parser->AddReal("Mapper.filter_min_tri_angle",
                  &command->options.min_angle_deg,
                  Between(0.0, 179.0, "degrees"),
                  "With database_path: leave out points whose largest angle "
                  "between two rays is smaller");
}

void RefuseOfOtherKind(const MatchesCommand& command,
                       const OptionParser& parser) {
  if (command.database_path.empty()) {
    parser.RefuseAll(
        {"image_path", "clear_points", "Mapper.filter_max_reproj_error",
         "Mapper.filter_min_tri_angle"},
        "without --database_path");
    return;
  }
  parser.RefuseAll(
      {"Solver.norm", "Solver.settings", "write_on_interrupt",
       "FastDescent.stationarity_tolerance", "FastDescent.step_tolerance",
       "FastDescent.slope_probe", "FastDescent.active_tolerance",
       "FastDescent.max_step", "FastDescent.max_iterations",
       "Problem.min_track_length", "Problem.same_image"},
      "with --database_path");
}

// Each point's colour becomes the mean of its pixels, in all photos that have
// the size of their camera.
void TakeColors(const std::string& image_path, const LogOptions& log,
                Model* model) {
  std::unordered_map<Point3DId, std::array<double, 4>> sums;
  std::unordered_map<CameraId, const Camera*> cameras;
  for (const Camera& camera : model->cameras) cameras[camera.id] = &camera;
  int64_t num_left_out = 0;
  for (const Image& image : model->images) {
    const Camera& camera = *cameras.at(image.camera_id);
    const auto photo = ReadPhoto(image_path + "/" + image.name);
    if (!photo || photo->width != static_cast<int64_t>(camera.width) ||
        photo->height != static_cast<int64_t>(camera.height)) {
      ++num_left_out;
      continue;
    }
    for (const Point2D& point : image.points2D) {
      if (point.point3D_id == kInvalidPoint3DId || !(point.x >= 0) ||
          !(point.y >= 0) || point.x >= photo->width ||
          point.y >= photo->height) {
        continue;
      }
      const size_t pixel = static_cast<size_t>(point.y) * photo->width +
                           static_cast<size_t>(point.x);
      std::array<double, 4>& sum = sums[point.point3D_id];
      for (size_t c = 0; c < 3; ++c) sum[c] += photo->rgb[3 * pixel + c];
      ++sum[3];
    }
  }
  for (Point3D& point : model->points3D) {
    const auto sum = sums.find(point.id);
    if (sum == sums.end()) continue;
    for (size_t c = 0; c < 3; ++c) {
      point.color[c] =
          static_cast<uint8_t>(std::lround(sum->second[c] / sum->second[3]));
    }
  }
  if (num_left_out > 0) {
    LogLine(log, 1,
            "no colours from " + Counted(num_left_out, "photo") + " in " +
                image_path +
                " that cannot be read or have another size than their camera");
  }
}

std::string WhyNoPoint(const MatchTracksSummary& summary) {
  if (summary.num_two_views > 0 &&
      summary.num_two_views == summary.num_components) {
    return "no match is confirmed by a third image, nor by a track of the "
           "model, which --clear_points 1 leaves out";
  }
  return "no matches of images that have poses agree with these; krot "
         "model_checker --database_path says what is wrong";
}

int RunOnMatches(const SolveCommand& command, const MatchesCommand& matches) {
  const Timer total_timer;
  const LogOptions& log = command.common.log;
  const ModelPaths& paths = command.paths;
  const WriteModelOptions write_options = CheckModelPaths(paths, log);
  TrackReport report;
  report.run.seed = command.common.random_seed;
  const Model model = ReadInput(paths, log, &report.run, false);
  BeginPhase(log, "reading " + matches.database_path);
  const Database database =
      ReadDatabase(matches.database_path, model, WarnOn(log));
  report.run.seconds_read = total_timer.Seconds();
  BeginPhase(log, "triangulating matches");
  const Timer timer;
  MatchTracksOptions options = matches.options;
  options.keeps_tracks = !matches.clear_points;
  MatchTracksResult result =
      TriangulateMatches(model, database, options, command.context);
  report.seconds_triangulate = timer.Seconds();
  if (result.model.points3D.empty()) {
    throw CommandError(kExitNothingToSolve,
                       "nothing to triangulate: " + WhyNoPoint(result.summary));
  }
  DeferInterrupts();
  if (!matches.image_path.empty()) {
    BeginPhase(log, "taking colours from " + matches.image_path);
    TakeColors(matches.image_path, log, &result.model);
  }
  const int num_threads = command.context.num_threads;
  report.summary = result.summary;
  report.num_points = static_cast<int64_t>(result.model.points3D.size());
  report.num_observations =
      static_cast<int64_t>(result.model.track_elements.size());
  report.pixel_error = Summarize(PixelErrors(result.model, num_threads));
  WriteOutput(result.model, paths, write_options, log, &report.run);
  RecordEnd(total_timer, num_threads, &report.run);
  WriteReports(paths.report_path, paths.html_path, TrackJson(report),
               result.model, result.model, num_threads, log);
  PrintTable(log, TrackTable(report));
  return kExitDone;
}

}  // namespace

int RunPointTriangulator(const std::vector<std::string>& arguments) {
  SolveCommand command;
  command.name = "point_triangulator";
  command.method_name = "intersection";
  OptionParser parser(command.name,
                      "re-estimates every point of a COLMAP model for the "
                      "lowest largest reprojection error of its track, or "
                      "makes the points from the matches of a database; the "
                      "frames stay");
  MatchesCommand matches;
  AddModelPaths(&command.paths, &parser);
  AddWriteOnInterrupt(&command.paths, &parser);
  AddSolveOptions(&command.options.solve, &command.context, &parser);
  AddMatchesOptions(&matches, &parser);
  AddCommonOptions(&command.common, &parser);
  if (!ParseOrPrintHelp(arguments, command.common.log, &parser))
    return kExitDone;
  RefuseOfOtherKind(matches, parser);
  if (!matches.database_path.empty()) return RunOnMatches(command, matches);
  CheckSolveOptions(command.options.solve, parser);
  command.options.solve = PointsOnly(command.options.solve);
  return RunSolveCommand(command);
}

}  // namespace krot::internal
