#pragma once

#include <limits>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

inline constexpr double kUnitRoundoff =
    std::numeric_limits<double>::epsilon() / 2;

// What CheckCertificate asks of its input before it proves anything. Each
// returns why the input is refused, one sentence without its full stop, or
// nothing.

// Finite numbers, a known norm, observations of the problem in ascending
// order, and |y|_dual <= lambda for each.
std::optional<std::string> RefuseNumbers(const KnownRotationProblem& problem,
                                         Norm norm,
                                         const Certificate& certificate);

// Every R_cw must be R_sr R_rw, to kRotationError per entry, for one R_rw per
// frame; and all must be rotations as far as the proof relies on it.
std::optional<std::string> RefuseRotations(const KnownRotationProblem& problem);

// "start" value "end", with all digits of the value.
std::string Sentence(const std::string& start, double value,
                     const std::string& end);

}  // namespace krot::internal
