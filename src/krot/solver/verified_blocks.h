#pragma once

#include <cstdint>
#include <optional>

#include "krot/solver/uncertain_system.h"

namespace krot {

// Proves that every such system has a solution, and bounds the length of one:
// |a|_2 <= the result, all roundings accounted for. For systems of any size
// that are not too badly conditioned.
//
// Any invertible T turns M a = -g into T M a = -T g with the same solutions;
// that of least length has |a| <= |T g| / sigma_min(T M). T is 3x3 blocks that
// make the blocks of H = T M M'T' on the diagonal, points eliminated for the
// frames', nearly the identity. sigma_min(T M)^2 = lambda_min(H) > c is proved
// by a Cholesky factorisation of H - c I that runs to its end [Rump 2006], for
// c a share of an estimate; what T M is not known by is taken off. In long
// double, as the theory's bound on the roundings grows with frames^2.
//
// None if no sigma_min above some 1e-7 can be shown, or if there are more than
// kMaxVerifiedFrames frames.
// O(observations track_length + frames^3), 144 bytes per pair of frames.
std::optional<double> BoundSolutionByBlocks(const UncertainSystem& system);

inline constexpr int64_t kMaxVerifiedFrames = 1500;

}  // namespace krot
