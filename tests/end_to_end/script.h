#pragma once

#include <string>

#include "tests/cli/krot_process.h"

namespace krot::internal {

// Runs tools/scripts/`name` with the krot that this build made.
KrotResult RunScript(const std::string& name, const Words& arguments);

}  // namespace krot::internal
