#include "tests/cli/colmap.h"

#include <cstdlib>

namespace krot::internal {

bool HasColmap() {
  return std::system("command -v colmap >/dev/null 2>&1") == 0;
}

bool RunColmap(const std::vector<std::string>& arguments,
               const std::filesystem::path& log) {
  std::string command = "QT_QPA_PLATFORM=offscreen colmap";
  for (const std::string& argument : arguments) {
    command += " '" + argument + "'";
  }
  command += " >'" + log.string() + "' 2>&1";
  return std::system(command.c_str()) == 0;
}

}  // namespace krot::internal
