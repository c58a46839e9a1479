// For builds without Boost: parsed by hand, and without project files.

#include "krot/options/option_table.h"
#include "tools/krot/given_options.h"

namespace krot::internal {

std::vector<OptionAssignment> GivenOptions(
    const std::vector<std::string>& arguments, const std::vector<Option>&,
    const std::function<void(const OptionAssignment&)>& check) {
  std::vector<OptionAssignment> assignments;
  for (size_t n = 0; n < arguments.size(); ++n) {
    const std::string& argument = arguments[n];
    if (argument.rfind("--", 0) != 0) {
      throw OptionError("unexpected argument '" + argument +
                        "'; options read --name value");
    }
    const size_t equals = argument.find('=');
    const std::string name = argument.substr(2, equals - 2);
    if (equals != std::string::npos) {
      assignments.push_back({name, argument.substr(equals + 1), "--" + name});
    } else if (n + 1 == arguments.size() ||
               arguments[n + 1].rfind("--", 0) == 0) {
      throw OptionError("--" + name + " has no value");
    } else {
      assignments.push_back({name, arguments[++n], "--" + name});
    }
    check(assignments.back());
  }
  return assignments;
}

std::vector<OptionAssignment> ReadProjectFile(const std::string& path,
                                              const std::vector<Option>&) {
  throw OptionError("--project_path = " + path +
                    ", this build reads no project files");
}

}  // namespace krot::internal
