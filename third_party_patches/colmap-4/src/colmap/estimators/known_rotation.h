// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#pragma once

#include "colmap/scene/reconstruction.h"

#include <string>

namespace colmap {

// The known rotation problem: rotations and intrinsics stay, translations and
// points take the lowest largest reprojection error, which is proved; of all
// such, the least squares. See KROT's docs/cli.md for each option.
struct KnownRotationOptions {
  // "model" or "feasible": from nothing but rotations and tracks.
  std::string init = "model";
  // Pixels. Above 0: few observations are left out so that all others are
  // within it.
  double max_error = 0.0;
  double relative_gap = 1e-4;
  std::string finish = "least_squares";
  std::string finish_loss = "trivial";
  int num_threads = -1;

  bool Check() const;
};

// Removes few observations so that all others are within max_error pixels.
struct OutlierFilterOptions {
  double max_error = 4.0;
  int num_threads = -1;

  bool Check() const;
};

// Both log KROT's table and return false, with the reconstruction untouched and
// the reason logged, where there is no result.
bool SolveKnownRotation(const KnownRotationOptions& options,
                        Reconstruction& reconstruction);
bool FilterOutliers(const OutlierFilterOptions& options,
                    Reconstruction& reconstruction);

// In the place of global positioning: rotations of the registered frames and
// the tracks of the 3D points are taken, positions are found, and what does not
// fit within max_error pixels (0: ten times the median error) is deleted. No
// random start. The cameras' intrinsics count as known.
bool RunKnownRotationPositioning(double max_error,
                                 int num_threads,
                                 Reconstruction& reconstruction);

}  // namespace colmap
