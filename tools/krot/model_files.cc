#include "tools/krot/model_files.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <utility>

#include "krot/analysis/model_comparison.h"
#include "krot/analysis/model_input.h"
#include "krot/base/context.h"
#include "krot/base/write_file.h"
#include "krot/check.h"
#include "krot/context.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/report/reports.h"
#include "krot/report/sentences.h"
#include "krot/report/text_table.h"
#include "tools/krot/report_files.h"
#include "tools/krot/run_log.h"
#include "tools/krot/same_path.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

ModelFormat OutputFormat(const ModelPaths& paths) {
  const ModelFormat input_format = DetectModelFormat(paths.input_path);
  if (paths.output_type == "BIN") return ModelFormat::kBinary;
  if (paths.output_type == "TXT") return ModelFormat::kText;
  return input_format;
}

// What takes no part and is written as it was read; "" if there is nothing.
std::string KeptWords(const Model& model) {
  int64_t num_images = 0;
  for (const Frame& frame : model.frames) {
    if (HasRotation(frame.rig_from_world.quaternion_wxyz)) continue;
    num_images += static_cast<int64_t>(frame.data.size());
  }
  int64_t num_points2D = 0;
  for (const Image& image : model.images) {
    num_points2D += std::count_if(
        image.points2D.begin(), image.points2D.end(), [](const Point2D& point) {
          return !std::isfinite(point.x) || !std::isfinite(point.y);
        });
  }
  std::string words;
  if (num_images > 0) {
    words =
        Counted(num_images, "image") + " without a rotation, so without a pose";
  }
  if (num_points2D > 0) {
    words += (words.empty() ? "" : " and ") +
             Counted(num_points2D, "2D point") +
             " in no track whose coordinates are not finite";
  }
  return words.empty() ? words : words + ": kept as read, and left out";
}

// Refuses names of COLMAP's files for other files.
void CheckSideName(const std::string& option, const std::string& path) {
  constexpr std::array<const char*, 5> kStems = {"cameras", "rigs", "frames",
                                                 "images", "points3D"};
  const fs::path name = fs::path(path).filename();
  bool is_taken = name == "project.ini";
  for (const char* stem : kStems) {
    is_taken |= name.stem() == stem &&
                (name.extension() == ".bin" || name.extension() == ".txt");
  }
  if (!is_taken) return;
  throw OptionError("--" + option + " = " + path +
                    ", must not bear the name of a model's file");
}

}  // namespace

void AddModelPaths(ModelPaths* paths, OptionParser* parser,
                   const char* output_meaning, const char* report_meaning) {
  parser->AddPath("input_path", &paths->input_path, true, "a folder",
                  "The COLMAP model to read, binary or text");
  const bool is_required = output_meaning == nullptr;
  parser->AddPath("output_path", &paths->output_path, is_required, "a folder",
                  is_required ? "Where the model goes" : output_meaning);
  parser->AddChoice("output_type", &paths->output_type, {"auto", "BIN", "TXT"},
                    "The format to write; auto: the input's");
  AddOverwrite(&paths->overwrite, parser);
  parser->AddOutputFile("report_path", &paths->report_path, report_meaning);
  AddHtmlPath(&paths->html_path, parser);
  AddOnContradiction(&paths->on_contradiction, parser);
}

void AddRotationsPath(ModelPaths* paths, OptionParser* parser) {
  parser->AddPath("rotations_path", &paths->rotations_path, false, "a file",
                  "Rotations to use in place of the model's: lines of NAME QW "
                  "QX QY QZ, camera from world");
}

void AddFixedPaths(ModelPaths* paths, OptionParser* parser) {
  parser->AddPath("fixed_images_path", &paths->fixed_images_path, false,
                  "a file",
                  "Images that must not move, by name or id, one per line");
  parser->AddPath("fixed_points_path", &paths->fixed_points_path, false,
                  "a file",
                  "3D points that must not move, by id, one per line");
}

void AddPositionsPath(ModelPaths* paths, OptionParser* parser) {
  parser->AddPath("positions_path", &paths->positions_path, false, "a file",
                  "Known positions of cameras: lines of NAME X Y Z RADIUS, or "
                  "in a frame of their own a database with pose priors");
  parser->AddPath("point_positions_path", &paths->point_positions_path, false,
                  "a file",
                  "Known positions of 3D points: lines of ID X Y Z RADIUS");
  parser->AddChoice("positions_frame", &paths->positions_frame,
                    {"model", "own"},
                    "Where known positions are: model: in the model's frame "
                    "and unit; own: in one of their own, say metres, which is "
                    "found first");
  parser->AddChoice("output_frame", &paths->output_frame, {"model", "own"},
                    "With positions_frame own: the frame and unit of the model "
                    "that is written, the model's or the positions'");
  parser->Add({"Problem.position_radius",
               "The radius of known positions whose lines have none",
               "a number > 0, in the positions' unit", "every line has its own",
               false, [paths](const std::string& text) {
                 paths->position_radius.emplace();
                 return ParseReal(text, &*paths->position_radius) &&
                        *paths->position_radius > 0;
               }});
}

void CheckPositionsPath(const ModelPaths& paths, const OptionParser& parser) {
  if (paths.positions_path.empty() && paths.point_positions_path.empty()) {
    parser.RefuseAll({"Problem.position_radius", "positions_frame"},
                     "without --positions_path or --point_positions_path");
  }
  if (paths.positions_frame != "own") {
    parser.Refuse("output_frame", "without --positions_frame own");
  }
}

void AddDistancesPath(std::string* path, OptionParser* parser) {
  parser->AddPath("distances_path", path, false, "a file",
                  "Known distances: lines of two images or two 3D points, and "
                  "METRES TOLERANCE");
}

void AddWriteOnInterrupt(ModelPaths* paths, OptionParser* parser) {
  parser->AddBool(
      "write_on_interrupt", &paths->write_on_interrupt,
      "On the first SIGINT or SIGTERM write the best estimate so far");
}

void AddOverwrite(bool* overwrite, OptionParser* parser) {
  parser->AddBool("overwrite", overwrite,
                  "Replace the model that the output folder holds; other "
                  "files in it stay");
}

WriteModelOptions CheckModelPaths(const ModelPaths& paths,
                                  const LogOptions& log) {
  CheckSideName("report_path", paths.report_path);
  if (IsSamePath(paths.input_path, paths.output_path) && !paths.overwrite) {
    throw OptionError(
        "--output_path is --input_path; add --overwrite 1 to replace the "
        "model");
  }
  WriteModelOptions options;
  options.format = OutputFormat(paths);
  options.overwrite = paths.overwrite;
  options.copy_project_from = paths.input_path;
  options.on_note = WarnOn(log);
  CheckWritable(paths.output_path, options);
  CheckSidePath("report_path", paths.report_path, paths.output_path);
  CheckSidePath("html_path", paths.html_path, paths.output_path);
  return options;
}

void CheckSidePath(const std::string& option, const std::string& path,
                   const std::string& folder_to_come) {
  if (path.empty()) return;
  CheckSideName(option, path);
  CheckFileWritable(path, folder_to_come);
}

void CheckOwnFolder(const std::string& option, const std::string& path,
                    const std::vector<std::string>& others,
                    const WriteModelOptions& options) {
  if (path.empty()) return;
  for (const std::string& other : others) {
    if (!IsSamePath(path, other)) continue;
    throw OptionError("--" + option + " = " + path +
                      ", must be a folder of its own");
  }
  CheckWritable(path, options);
}

void ThrowInterrupted(const ModelPaths& paths) {
  throw CommandError(kExitInterrupted, "interrupted; " + paths.output_path +
                                           " holds the best estimate so far");
}

void AddOnContradiction(std::string* on_contradiction, OptionParser* parser) {
  parser->AddChoice(
      "Model.on_contradiction", on_contradiction,
      {"auto", "follow_tracks", "follow_images", "refuse"},
      "What counts where tracks and images name different observations: auto: "
      "the side that fits the model's positions; follow_tracks: the tracks; "
      "follow_images: the images; refuse: such a model is not read");
}

PoseChecks DescribeInput(const std::string& path, const Model& model,
                         const LogOptions& log) {
  PoseChecks poses = CheckPoses(model);
  for (const std::string& sentence : PoseSentences(poses)) {
    LogLine(log, 1, "warning: " + path + ": " + sentence);
  }
  const std::string kept = KeptWords(model);
  if (!kept.empty()) LogLine(log, 1, path + ": " + kept);
  return poses;
}

ValidModel ReadValidModel(const std::string& path,
                          const std::string& on_contradiction,
                          const LogOptions& log) {
  LogInput(path);
  BeginPhase(log, "reading " + path);
  ValidModel read;
  read.model = ReadModel(path, DetectModelFormat(path));
  read.contradictions = SettleContradictions(on_contradiction, &read.model);
  ValidateModel(read.model);
  read.poses = DescribeInput(path, read.model, log);
  if (!read.contradictions.Any()) return read;
  if (on_contradiction == "refuse") throw ModelError(read.contradictions.first);
  RequireSettled(path, read.contradictions);
  // If no model has tracks, "nothing to solve" is the only thing to say.
  if (HasTrack(read.model)) {
    LogLine(log, 1,
            "warning: " + path + ContradictionSentence(read.contradictions));
  }
  return read;
}

void WarnOfDegeneration(const Model& input, const Model& written,
                        const LogOptions& log) {
  const Collapse collapse = FindCollapse(input, written);
  if (collapse.IsWhole()) {
    LogLine(log, 0,
            "warning: what was written is of no use: " +
                WholeCollapseWords(collapse) +
                "; most likely the observations name the wrong 2D points");
  } else {
    std::istringstream lines(CollapseLines(collapse));
    for (std::string line; std::getline(lines, line);) {
      LogLine(log, 0, "warning: " + line);
    }
  }
  if (const auto worse = WorseImagesSide(input, written)) {
    LogLine(log, 0,
            "warning: " + WorseImagesWords(*worse) +
                "; --Model.on_contradiction auto writes a model that agrees "
                "with itself");
  }
}

namespace {

// Files whose writer had no 2D points: anything fits such observations.
bool HasPixels(const Model& model) {
  bool has_several = false;
  for (const Image& image : model.images) {
    has_several |= image.points2D.size() > 1;
    for (const Point2D& point : image.points2D) {
      const Point2D& first = image.points2D.front();
      if (point.x != first.x || point.y != first.y) return true;
    }
  }
  return !has_several;
}

}  // namespace

Model ReadInput(const ModelPaths& paths, const LogOptions& log, RunRecord* run,
                bool needs_observations) {
  const Timer timer;
  ValidModel read =
      ReadValidModel(paths.input_path, paths.on_contradiction, log);
  run->contradictions = read.contradictions;
  if (needs_observations && read.model.track_elements.empty()) {
    throw CommandError(kExitNothingToSolve,
                       std::string("nothing to solve: ") + kNoObservations);
  }
  if (needs_observations && !HasPixels(read.model)) {
    throw CommandError(
        kExitNothingToSolve,
        "nothing to solve: in each image all 2D points are at one "
        "place; take the model that COLMAP wrote");
  }
  run->poses = read.poses;
  if (!paths.rotations_path.empty()) {
    LogInput(paths.rotations_path);
    run->rotations = TakeRotations(ReadFileBytes(paths.rotations_path),
                                   &read.model, -1, WarnOn(log));
    LogLine(log, 1, RotationsSentence(paths.rotations_path, *run->rotations));
  }
  run->seconds_read = timer.Seconds();
  return std::move(read.model);
}

void WarnOfConventions(const ModelPaths& paths, const Model& model,
                       const LogOptions& log) {
  if (!paths.rotations_path.empty()) return;
  BeginPhase(log, "asking how its poses are written");
  const auto conventions = FindConventions(model);
  if (!conventions) return;
  LogLine(log, 0,
          "warning: " + paths.input_path + ": " +
              ConventionsSentence(*conventions) +
              " krot model_checker --output_path writes it so");
}

void WarnOfWhiteSpace(const Model& model, const WriteModelOptions& options,
                      const LogOptions& log) {
  const std::vector<std::string> names = ImageNamesWithWhiteSpace(model);
  if (names.empty() || options.format != ModelFormat::kText) return;
  LogLine(log, 1,
          "warning: " + Counted(names.size(), "image name") +
              " with white space, at which COLMAP ends a name when it reads "
              "text: '" +
              names.front() + "' for one; --output_type BIN avoids that");
}

void WriteOutput(const Model& model, const ModelPaths& paths,
                 const WriteModelOptions& options, const LogOptions& log,
                 RunRecord* run) {
  BeginPhase(log, "writing " + paths.output_path);
  const Timer timer;
  WarnOfWhiteSpace(model, options, log);
  WriteModel(model, paths.output_path, options);
  run->seconds_write = timer.Seconds();
}

FixedParts ReadFixedParts(const ModelPaths& paths, const Model& model,
                          const LogOptions& log) {
  FixedParts fixed;
  if (!paths.fixed_images_path.empty()) {
    LogInput(paths.fixed_images_path);
    fixed.frames =
        FixedFrames(ReadFileBytes(paths.fixed_images_path), model, WarnOn(log));
  }
  if (!paths.fixed_points_path.empty()) {
    LogInput(paths.fixed_points_path);
    fixed.points3D = FixedPoints3D(ReadFileBytes(paths.fixed_points_path),
                                   model, WarnOn(log));
  }
  return fixed;
}

}  // namespace krot::internal
