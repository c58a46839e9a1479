#include "tools/krot/solve_command.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/write_file.h"
#include "krot/database.h"
#include "krot/outliers/match_tracks.h"
#include "krot/outliers/robust_start.h"
#include "krot/problem/cost.h"
#include "krot/report/reports.h"
#include "krot/report/text_table.h"
#include "tools/krot/interrupt.h"
#include "tools/krot/metres.h"
#include "tools/krot/report_files.h"
#include "tools/krot/solve_progress.h"

namespace krot::internal {
namespace {

SolveReport DescribeRun(const SolveCommand& command) {
  SolveReport report;
  report.command = command.name;
  report.method = command.method_name;
  report.run.seed = command.common.random_seed;
  return report;
}

std::string FixedWords(const SolveSummary& summary) {
  if (summary.num_fixed_frames + summary.num_fixed_points == 0) return "";
  return ", of which " + Counted(summary.num_fixed_frames, "frame") + " and " +
         Counted(summary.num_fixed_points, "point") + " stay";
}

std::string ProblemWords(const SolveSummary& summary) {
  return Counted(summary.num_images, "image") + ", " +
         Counted(summary.num_points, "point") + ", " +
         Counted(summary.num_observations, "observation") +
         (summary.num_components > 1
              ? " in " + std::to_string(summary.num_components) + " components"
              : std::string()) +
         FixedWords(summary) +
         (summary.num_positions > 0
              ? ", " + Counted(summary.num_positions, "known position")
              : std::string());
}

std::string MemoryWords(const SolveSummary& summary) {
  return "about " + FormatBytes(summary.needed_bytes) + " will be needed";
}

// The announced memory has been up to so many times the peak
// (docs/method/joint_solver.md, "Memory").
constexpr double kMostAnnounced = 1.3;

// Refuses to begin what surely does not fit in memory.
void CheckMemory(const SolveSummary& summary) {
  const int64_t free = FreeMemoryBytes();
  const auto least = static_cast<int64_t>(
      static_cast<double>(summary.needed_bytes) / kMostAnnounced);
  if (least - ResidentBytes() <= free) return;
  throw CommandError(kExitInternal,
                     "out of memory before it began: " + MemoryWords(summary) +
                         ", " + FormatBytes(free) +
                         " are free; --Problem.min_track_length 3 takes less");
}

// Solves, with progress on stderr. Throws CommandError if there is nothing to
// write afterwards.
Model Solve(const SolveCommand& command, const Model& model, const Context& how,
            Checkpoint* checkpoint, SolveReport* report) {
  const LogOptions& log = command.common.log;
  TolerantSolveOptions options = command.options;
  options.solve.problem.fixed = ReadFixedParts(command.paths, model, log);
  KnownPositions known = ReadKnownPositions(command.paths, model, log);
  options.solve.problem.positions = std::move(known.positions);
  report->position_frame = std::move(known.frame);
  options.has_other_rotations = report->run.rotations.has_value();
  options.solve.checkpoint = checkpoint;
  Context context = how;
  SolveProgress progress(log, SolveProgress::GoalsOf(options.solve));
  progress.Follow(&options.solve, &context);
  options.find_conflicts = !command.conflicts_path.empty();
  options.solve.describe_certificate = !command.certificate_path.empty();
  options.solve.on_built = [&](const SolveSummary& summary) {
    if (summary.num_observations == 0) {
      throw CommandError(kExitNothingToSolve, NothingToSolveSentence(summary));
    }
    if (command.take_share) {
      LogLine(log, 1, ProblemWords(summary));
      return;
    }
    LogLine(log, 1, ProblemWords(summary) + "; " + MemoryWords(summary));
    CheckMemory(summary);
  };
  BeginPhase(log, "building the problem");
  TolerantSolveResult result = SolveTolerantly(model, options, context);
  EndProgress();
  report->summary = std::move(result.summary);
  report->outliers = std::move(result.outliers);
  return std::move(result.model);
}

// Makes positions and points from the matches of a database. Throws
// CommandError if there is nothing to make them from.
Model PlaceByMatches(const SolveCommand& command, const Model& model,
                     SolveReport* report, double* seconds) {
  const LogOptions& log = command.common.log;
  BeginPhase(log, "reading " + command.database_path);
  const Database database =
      ReadDatabase(command.database_path, model, WarnOn(log));
  const Timer timer;
  SolveModelOptions unused;
  Context context = command.context;
  SolveProgress progress(log, SolveProgress::GoalsOf(unused));
  progress.Follow(&unused, &context);
  MatchTracksOptions options;
  options.max_error_px =
      command.options.max_error.value_or(options.max_error_px);
  PlacedMatches placed = PlaceMatches(model, database, options, context);
  EndProgress();
  *seconds = timer.Seconds();
  if (placed.model.points3D.empty()) {
    throw CommandError(kExitNothingToSolve,
                       "nothing to solve: no matches of " +
                           command.database_path +
                           " agree with the rotations; krot model_checker "
                           "--database_path says which pairs do not");
  }
  report->matches = placed.summary;
  if (placed.num_unplaced > 0) {
    LogLine(log, 0,
            "warning: no matches hold " +
                Counted(placed.num_unplaced, "image") + ", which " +
                (placed.num_unplaced == 1 ? "stays" : "stay") +
                " where the input has " +
                (placed.num_unplaced == 1 ? "it" : "them") +
                "; leave out what the input does not place, or match more "
                "pairs of images");
  }
  return std::move(placed.model);
}

void WriteConflicts(const SolveCommand& command, const SolveReport& report) {
  if (command.conflicts_path.empty() || !report.outliers->conflicts) return;
  BeginPhase(command.common.log, "writing " + command.conflicts_path);
  WriteFileAtomically(command.conflicts_path,
                      ConflictJson(*report.outliers->conflicts));
}

void WriteCertificate(const SolveCommand& command, const std::string& path,
                      const std::optional<CertificateFile>& certificate) {
  if (!certificate || path.empty()) return;
  BeginPhase(command.common.log, "writing " + path);
  WriteFileAtomically(path, CertificateJson(*certificate));
}

void WriteCertificates(const SolveCommand& command,
                       const SolveSummary& summary) {
  WriteCertificate(command, command.certificate_path, summary.certificate);
  if (!summary.position_factor) return;
  WriteCertificate(command, command.factor_certificate_path,
                   summary.position_factor->certificate);
}

// For example "; in conflict are the positions of a.jpg, b.jpg and 12
// observations".
std::string PositionsConflictWords(const SolveSummary& summary) {
  constexpr size_t kMost = 5;
  const std::vector<SupportPosition>& positions = summary.support_positions;
  std::string names;
  for (size_t n = 0; n < std::min(kMost, positions.size()); ++n) {
    names += (n == 0 ? "" : ", ") + positions[n].Name();
  }
  if (positions.size() > kMost) {
    names += " and " + std::to_string(positions.size() - kMost) + " others";
  }
  return positions.empty()
             ? TextIf(!summary.support.empty(),
                      "; no position is part of the conflict")
             : "; in conflict are the positions of " + names + " and " +
                   Counted(static_cast<int64_t>(summary.support.size()),
                           "observation");
}

// Ends the command if there is no model to write; at most a proof is written.
void ThrowIfNoStart(const SolveCommand& command, const SolveReport& report) {
  const SolveSummary& summary = report.summary;
  if (report.outliers &&
      summary.termination == SolveTermination::kNothingToSolve) {
    throw CommandError(kExitNothingToSolve,
                       "nothing to solve: no track keeps two observations");
  }
  if (summary.termination == SolveTermination::kNothingToSolve) {
    throw CommandError(kExitNothingToSolve, NothingToSolveSentence(summary));
  }
  const SolveModelOptions& options = command.options.solve;
  const std::string bound =
      (options.inflate_positions_to
           ? "Problem.inflate_positions = " +
                 FormatNumber(*options.inflate_positions_to, 6)
           : "Problem.init_max_error = " +
                 FormatNumber(options.init_max_error, 6)) +
      " px";
  if (summary.termination == SolveTermination::kInfeasible) {
    WriteCertificates(command, summary);
    throw CommandError(
        kExitNoStart,
        "infeasible: " +
            (summary.lower_bound
                 ? "the largest error of every estimate is proved to be at "
                   "least " +
                       FormatNumber(*summary.lower_bound, 6) + " px, above "
                 : std::string("no estimate is below ")) +
            bound +
            (options.inflate_positions_to
                 ? std::string(", with radii a million times as large")
             : summary.num_positions > 0
                 ? PositionsConflictWords(summary)
                 : std::string(
                       "; --Solver.max_error leaves out what does not fit")));
  }
  if (summary.termination == SolveTermination::kNoStart) {
    throw CommandError(kExitNoStart, "no start was found below " + bound +
                                         ", and no proof that there is none");
  }
}

// An interrupted solve has something to write if a round has given an estimate
// of all observations.
void ThrowIfNothingSoFar(const SolveReport& report) {
  if (report.summary.termination != SolveTermination::kInterrupted) return;
  if (!report.outliers && !report.summary.rounds.empty()) return;
  throw CommandError(
      kExitInterrupted,
      "interrupted before there was an estimate, nothing was written");
}

bool AreIdentity(const Model& model) {
  const auto all = [](const auto& items, const auto& pose_of) {
    return std::all_of(items.begin(), items.end(), [&](const auto& item) {
      return pose_of(item).Rotation().isIdentity(0);
    });
  };
  return model.frames.empty()
             ? all(model.images,
                   [](const Image& image) { return image.cam_from_world; })
             : all(model.frames,
                   [](const Frame& frame) { return frame.rig_from_world; });
}

// Warns of identity rotations, unless the result shows that they are right.
void WarnOfIdentity(const LogOptions& log, const Model& model,
                    const SolveReport& report) {
  const SolveTermination end = report.summary.termination;
  const auto& outliers = report.outliers;
  const bool fits =
      end != SolveTermination::kInfeasible &&
      end != SolveTermination::kNoStart &&
      report.summary.pixel_error_after.mean <= kLevelOfStart &&
      (!outliers || 2 * static_cast<int64_t>(outliers->removed.size()) <=
                        outliers->num_observations);
  if (fits || !AreIdentity(model)) return;
  LogLine(log, 0,
          "warning: all rotations are the identity, as where none were "
          "estimated, and the observations do not fit them; expected those of "
          "a mapper, of rotation averaging or of a sensor (--rotations_path)");
}

// Warns of errors that fell to zero and say nothing.
void WarnOfEmptyFall(const LogOptions& log, const SolveSummary& summary) {
  const bool is_zero = IsZeroUpToRounding(summary.cost_final) &&
                       !IsZeroUpToRounding(summary.cost_initial);
  if (summary.termination == SolveTermination::kCollapsed ||
      summary.worse_images_side) {
    LogLine(log, 0, "warning: " + GivenBackSentence(summary));
  } else if (is_zero && summary.is_underdetermined) {
    LogLine(log, 0,
            "warning: errors of zero say nothing: " +
                UnderdeterminedWords(summary));
  }
}

void WarnOfMissedGap(const SolveCommand& command, const SolveSummary& summary) {
  const LogOptions& log = command.common.log;
  if (summary.method == SolveMethod::kResInt ||
      summary.termination == SolveTermination::kCollapsed) {
    return;
  }
  if (summary.termination != SolveTermination::kGapReached &&
      summary.termination != SolveTermination::kWithinBound &&
      summary.termination != SolveTermination::kZeroCost) {
    LogLine(log, 0, "warning: " + MissedGapSentence(summary));
  }
  if (!command.certificate_path.empty() && !summary.certificate) {
    LogLine(log, 0,
            "warning: there is no certificate, so " + command.certificate_path +
                " is not written");
  }
}

// One wrong observation can set the maximum, and all others pay for it. On
// models without any the mean error rises by up to a half after a finish.
void PointToOutlierFilter(const LogOptions& log, const SolveReport& report) {
  constexpr double kMuch = 2;
  const PixelErrorStatistics& before = report.summary.pixel_error_before;
  const PixelErrorStatistics& after = report.summary.pixel_error_after;
  if (report.outliers || !report.summary.finish ||
      before.count != after.count ||
      report.summary.termination == SolveTermination::kZeroCost ||
      !(after.mean > kMuch * before.mean)) {
    return;
  }
  LogLine(log, 0,
          "warning: the mean error has risen from " +
              FormatNumber(before.mean, 4) + " to " +
              FormatNumber(after.mean, 4) +
              " px: a few errors, far larger than the others, fell at the "
              "others' cost; if those observations are wrong, krot "
              "outlier_filter removes them");
}

}  // namespace

int RunSolveCommand(const SolveCommand& command) {
  const Timer total_timer;
  const LogOptions& log = command.common.log;
  const ModelPaths& paths = command.paths;
  const WriteModelOptions write_options = CheckModelPaths(paths, log);
  CheckSidePath("certificate_path", command.certificate_path,
                paths.output_path);
  CheckSidePath("factor_certificate_path", command.factor_certificate_path,
                paths.output_path);
  CheckSidePath("checkpoint_path", command.checkpoint.path);
  CheckSidePath("conflicts_path", command.conflicts_path, paths.output_path);
  SolveReport report = DescribeRun(command);

  const bool has_database = !command.database_path.empty();
  Model model = command.read
                    ? command.read(&report.run)
                    : ReadInput(paths, log, &report.run, !has_database);
  double seconds_placed = 0;
  if (has_database) {
    model = PlaceByMatches(command, model, &report, &seconds_placed);
  }
  if (!has_database) WarnOfConventions(paths, model, log);
  report.distances = ReadKnownDistances(paths, model, log);
  const std::unique_ptr<Checkpoint> checkpoint =
      OpenCheckpoint(command.checkpoint, paths, model, command.context, log);
  if (command.take_share) model = command.take_share(std::move(model));

  Context context = command.context;
  if (paths.write_on_interrupt || command.checkpoint.is_all) {
    context.cancel = &DeferInterrupts();
  }
  Model solved = Solve(command, model, context, checkpoint.get(), &report);
  report.summary.seconds_solve += seconds_placed;
  DeferInterrupts();
  if (command.method_name.empty()) {
    report.method = MethodName(report.summary.method);
  }
  WarnOfIdentity(log, model, report);
  ThrowIfNoStart(command, report);
  ThrowIfNothingSoFar(report);
  if (command.join && !command.join(&model, &solved, &report.summary)) {
    return kExitDone;
  }

  WarnOfWhiteSpace(solved, write_options, log);
  MeasureSolved(solved, log, &report);
  BeginPhase(log, "writing " + paths.output_path);
  const Timer write_timer;
  const std::optional<Model> moved = InOutputFrame(paths, solved, &report);
  WriteModel(moved ? *moved : solved, paths.output_path, write_options);
  report.run.seconds_write = write_timer.Seconds();
  RecordEnd(total_timer, command.context.num_threads, &report.run);
  WriteCertificates(command, report.summary);
  WriteConflicts(command, report);
  WriteReports(paths.report_path, paths.html_path, SolveJson(report), model,
               solved, command.context.num_threads, log);
  PrintTable(log, SolveTable(report));
  if (context.IsCancelled()) ThrowInterrupted(paths);
  RemoveCheckpoint(command.checkpoint, log);
  WarnOfEmptyFall(log, report.summary);
  WarnOfMissedGap(command, report.summary);
  PointToOutlierFilter(log, report);
  const std::string unreliable =
      report.outliers ? UnreliableSentence(*report.outliers) : "";
  if (!unreliable.empty()) {
    LogLine(log, 0, "warning: " + unreliable);
    return kExitUnreliable;
  }
  const bool is_copy = report.summary.is_given_back && !report.summary.polish;
  return is_copy ? kExitGivenBack : kExitDone;
}

}  // namespace krot::internal
