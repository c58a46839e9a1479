// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#pragma once

#include "colmap/estimators/global_positioning.h"
#include "colmap/scene/reconstruction.h"
#include "colmap/util/enum_utils.h"

#include <filesystem>
#include <functional>

namespace colmap {

// Where the solver starts: from the reconstruction's translations and points,
// or from nothing but rotations and tracks.
MAKE_ENUM_CLASS_OVERLOAD_STREAM(KnownRotationInit, 0, MODEL, FEASIBLE);

// What is chosen among all estimates with the lowest largest error: the least
// squares, or any.
MAKE_ENUM_CLASS_OVERLOAD_STREAM(KnownRotationFinish, 0, LEAST_SQUARES, NONE);

// The known rotation problem: rotations and intrinsics stay, translations and
// points take the lowest largest reprojection error, which is proved.
struct KnownRotationOptions {
  KnownRotationInit init = KnownRotationInit::MODEL;

  // Pixels. Above 0: few observations are left out so that all others are
  // within it. 0: all observations stay. With FEASIBLE, 0 leaves out what noise
  // does not explain, unless the reconstruction's own positions fit.
  double max_error = 0.0;

  // How far the largest error may be above the proved lower bound, relative to
  // it; > 0.
  double relative_gap = 1e-4;

  KnownRotationFinish finish = KnownRotationFinish::LEAST_SQUARES;

  // -1: all.
  int num_threads = -1;

  // Asked some ten times a second, if set. Once it is true, the solver stops.
  std::function<bool()> check_if_stopped;

  bool Check() const;
};

// Removes few observations so that all others are within max_error.
struct OutlierFilterOptions {
  // Pixels, > 0.
  double max_error = 4.0;

  // Whether to prove how many observations had to go at least. The proof takes
  // most of the time and changes nothing in the result.
  bool prove = true;

  // Where the proof goes, as JSON; empty: nowhere. Requires prove.
  std::filesystem::path conflicts_path;

  // As in KnownRotationOptions.
  int num_threads = -1;
  std::function<bool()> check_if_stopped;

  bool Check() const;
};

// Both log what was reached. They return false, with the reconstruction
// untouched and the reason logged, where there is no result.
bool SolveKnownRotation(const KnownRotationOptions& options,
                        Reconstruction& reconstruction);
bool FilterOutliers(const OutlierFilterOptions& options,
                    Reconstruction& reconstruction);

struct ModelCheckerOptions {
  // How many images of each kind, and observations, to log.
  int num_worst = 10;

  // -1: all.
  int num_threads = -1;

  bool Check() const;
};

struct ModelCheckerSummary {
  // Whether other observations check any; nothing is known if not.
  bool is_checked = false;
  // Which contradict the others by more than their noise explains.
  int num_wrong_images = 0;
  int num_wrong_observations = 0;
  // Whose position the observations determine ten times worse than the median
  // image's.
  int num_weak_images = 0;
};

// Logs which images and observations of a reconstruction are wrong, and removes
// wrong observations and all observations of wrong images. Cameras stay.
ModelCheckerSummary CheckReconstruction(const ModelCheckerOptions& options,
                                        Reconstruction& reconstruction);

// Global positioning with GlobalPositionerBackend::KROT: takes the rotations of
// the registered frames and the tracks of the 3D points, finds all positions,
// and deletes what does not fit within krot_max_error. The start is not random.
// All cameras need a prior focal length and a known sensor_from_rig.
bool RunKnownRotationPositioning(const GlobalPositionerOptions& options,
                                 Reconstruction& reconstruction);

}  // namespace colmap
