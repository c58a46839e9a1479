#pragma once

#include <string>
#include <vector>

namespace krot::internal {

struct ScriptResult {
  int exit_code = -1;
  std::string out;
  std::string err;
};

// Runs tools/scripts/`name` with the krot that this build made.
ScriptResult RunScript(const std::string& name,
                       const std::vector<std::string>& arguments);

}  // namespace krot::internal
