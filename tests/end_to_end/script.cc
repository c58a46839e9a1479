#include "tests/end_to_end/script.h"

#include <sys/wait.h>

#include <cstdlib>

#include "tests/testing/model_matchers.h"

namespace krot::internal {

KrotResult RunScript(const std::string& name, const Words& arguments) {
  const TempFolder folder;
  std::string command =
      "KROT='" KROT_EXECUTABLE "' '" KROT_SCRIPTS "/" + name + "'";
  for (const std::string& argument : arguments) {
    command += " '" + argument + "'";
  }
  command += " >'" + (folder / "out").string() + "' 2>'" +
             (folder / "err").string() + "'";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1,
          ReadBytes(folder / "out"), ReadBytes(folder / "err")};
}

}  // namespace krot::internal
