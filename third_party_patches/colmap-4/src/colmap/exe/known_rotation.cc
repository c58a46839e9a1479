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

// Reads, runs, writes.
template <typename Command>
int RunOnModel(const std::filesystem::path& input_path,
               const std::filesystem::path& output_path,
               const Command& command) {
  if (!ExistsDir(input_path)) {
    LOG(ERROR) << "input_path is not a directory";
    return EXIT_FAILURE;
  }
  if (!ExistsDir(output_path)) {
    LOG(ERROR) << "output_path is not a directory";
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
  options.AddDefaultOption("KnownRotation.init",
                           &known_rotation.init,
                           "{model, feasible}: the latter from nothing but "
                           "rotations and tracks");
  options.AddDefaultOption("KnownRotation.max_error",
                           &known_rotation.max_error,
                           "Pixels; above 0: leave out few observations so "
                           "that all others are within it");
  options.AddDefaultOption("KnownRotation.relative_gap",
                           &known_rotation.relative_gap,
                           "How far the largest error may be above the proved "
                           "bound");
  options.AddDefaultOption("KnownRotation.finish",
                           &known_rotation.finish,
                           "{least_squares, sweeps, none}");
  options.AddDefaultOption("KnownRotation.finish_loss",
                           &known_rotation.finish_loss,
                           "{trivial, huber, cauchy}");
  options.AddDefaultOption("KnownRotation.num_threads",
                           &known_rotation.num_threads);
  if (!options.Parse(argc, argv) || !known_rotation.Check()) {
    return EXIT_FAILURE;
  }
  return RunOnModel(input_path, output_path, [&](Reconstruction& model) {
    return SolveKnownRotation(known_rotation, model);
  });
}

int RunOutlierFilter(int argc, char** argv) {
  std::filesystem::path input_path;
  std::filesystem::path output_path;
  OutlierFilterOptions outlier_filter;

  OptionManager options;
  options.AddRequiredOption("input_path", &input_path);
  options.AddRequiredOption("output_path", &output_path);
  options.AddDefaultOption("OutlierFilter.max_error",
                           &outlier_filter.max_error,
                           "The bound that all errors are to be within, px");
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
