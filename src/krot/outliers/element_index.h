#pragma once

#include <cstdint>
#include <vector>

#include "krot/bridge/bridge.h"
#include "krot/model.h"

namespace krot::internal {

// Where each observation of a built problem stands among the model's track
// elements. O(track elements).
std::vector<uint64_t> ElementsOf(const Model& model, const BuiltProblem& built);

}  // namespace krot::internal
