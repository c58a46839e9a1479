#pragma once

#include <string>
#include <vector>

#include "krot/analysis/rotation_input.h"
#include "krot/model/pose_checks.h"

namespace krot::internal {

// What a user should know of the poses that were read; empty if nothing is odd.
std::vector<std::string> PoseSentences(const PoseChecks& poses);

// What the rotations of the file `path` did; begins with "warning: " where they
// are probably wrong.
std::string RotationsSentence(const std::string& path,
                              const RotationInput& input);

}  // namespace krot::internal
