// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#include "colmap/exe/known_rotation.h"

#include "colmap/controllers/option_manager.h"
#include "colmap/estimators/known_rotation.h"
#include "colmap/scene/reconstruction.h"
#include "colmap/util/file.h"
#include "colmap/util/logging.h"

#include <cstdlib>
#include <filesystem>

namespace colmap {
namespace {

bool IsDirectory(const char* option, const std::filesystem::path& path) {
  if (ExistsDir(path)) return true;
  LOG(ERROR) << option << " is not a directory: " << path;
  return false;
}

// Reads, runs, writes.
template <typename Command>
int RunOnModel(const std::filesystem::path& input_path,
               const std::filesystem::path& output_path,
               const Command& command) {
  if (!IsDirectory("input_path", input_path) ||
      !IsDirectory("output_path", output_path)) {
    return EXIT_FAILURE;
  }
  Reconstruction reconstruction;
  reconstruction.Read(input_path);
  if (!command(reconstruction)) return EXIT_FAILURE;
  reconstruction.Write(output_path);
  return EXIT_SUCCESS;
}

}  // namespace

int RunKnownRotationSolver(int argc, char** argv) {
  std::filesystem::path input_path;
  std::filesystem::path output_path;
  KnownRotationOptions known_rotation;

  OptionManager options;
  options.AddRequiredOption("input_path", &input_path);
  options.AddRequiredOption("output_path", &output_path);
  options.AddDefaultEnumOption("KnownRotation.init",
                               &known_rotation.init,
                               KnownRotationInitToString,
                               KnownRotationInitFromString,
                               "{MODEL, FEASIBLE}; FEASIBLE starts from "
                               "nothing but rotations and tracks");
  options.AddDefaultOption("KnownRotation.max_error",
                           &known_rotation.max_error,
                           "Leave out few observations so that all others are "
                           "within so many pixels; 0: none, or with "
                           "FEASIBLE what noise does not explain");
  options.AddDefaultOption("KnownRotation.relative_gap",
                           &known_rotation.relative_gap,
                           "How far the largest error may be above the proved "
                           "lower bound");
  options.AddDefaultEnumOption(
      "KnownRotation.finish",
      &known_rotation.finish,
      KnownRotationFinishToString,
      KnownRotationFinishFromString,
      "{LEAST_SQUARES, NONE}; what to choose among all estimates with "
      "the lowest largest error");
  options.AddDefaultOption("KnownRotation.num_threads",
                           &known_rotation.num_threads);
  if (!options.Parse(argc, argv) || !known_rotation.Check()) {
    return EXIT_FAILURE;
  }
  return RunOnModel(input_path, output_path, [&](Reconstruction& model) {
    return SolveKnownRotation(known_rotation, model);
  });
}

int RunModelChecker(int argc, char** argv) {
  std::filesystem::path input_path;
  std::filesystem::path output_path;
  ModelCheckerOptions model_checker;
  bool fail_on_wrong = false;

  OptionManager options;
  options.AddRequiredOption("input_path", &input_path);
  options.AddDefaultOption("output_path",
                           &output_path,
                           "Where the model without wrong images and "
                           "observations goes; empty: nowhere");
  options.AddDefaultOption("ModelChecker.num_worst",
                           &model_checker.num_worst,
                           "How many images of each kind, and observations, to "
                           "log");
  options.AddDefaultOption("ModelChecker.fail_on_wrong",
                           &fail_on_wrong,
                           "Whether to exit with an error if an image or an "
                           "observation is wrong");
  options.AddDefaultOption("ModelChecker.num_threads",
                           &model_checker.num_threads);
  if (!options.Parse(argc, argv) || !model_checker.Check()) {
    return EXIT_FAILURE;
  }
  if (!IsDirectory("input_path", input_path) ||
      (!output_path.empty() && !IsDirectory("output_path", output_path))) {
    return EXIT_FAILURE;
  }
  Reconstruction reconstruction;
  reconstruction.Read(input_path);
  const ModelCheckerSummary summary =
      CheckReconstruction(model_checker, reconstruction);
  if (!summary.is_checked) return EXIT_FAILURE;
  if (!output_path.empty()) reconstruction.Write(output_path);
  const bool is_wrong =
      summary.num_wrong_images > 0 || summary.num_wrong_observations > 0;
  return fail_on_wrong && is_wrong ? EXIT_FAILURE : EXIT_SUCCESS;
}

int RunOutlierFilter(int argc, char** argv) {
  std::filesystem::path input_path;
  std::filesystem::path output_path;
  OutlierFilterOptions outlier_filter;

  OptionManager options;
  options.AddRequiredOption("input_path", &input_path);
  options.AddRequiredOption("output_path", &output_path);
  options.AddDefaultOption(
      "OutlierFilter.max_error",
      &outlier_filter.max_error,
      "The bound that all errors are to be within, pixels");
  options.AddDefaultOption("OutlierFilter.prove",
                           &outlier_filter.prove,
                           "Whether to prove how many observations had to go "
                           "at least, which takes most of the time");
  options.AddDefaultOption("OutlierFilter.conflicts_path",
                           &outlier_filter.conflicts_path,
                           "Where that proof goes, as JSON; empty: nowhere");
  options.AddDefaultOption("OutlierFilter.num_threads",
                           &outlier_filter.num_threads);
  if (!options.Parse(argc, argv) || !outlier_filter.Check()) {
    return EXIT_FAILURE;
  }
  return RunOnModel(input_path, output_path, [&](Reconstruction& model) {
    return FilterOutliers(outlier_filter, model);
  });
}

}  // namespace colmap
