// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#pragma once

namespace colmap {

int RunKnownRotationSolver(int argc, char** argv);
int RunModelChecker(int argc, char** argv);
int RunOutlierFilter(int argc, char** argv);

}  // namespace colmap
