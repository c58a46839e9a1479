#pragma once

#include <functional>
#include <string>
#include <vector>

#include "krot/options/option_table.h"

namespace krot::internal {

// The options `--name value` and `--name=value` among the arguments, in their
// order; `check` sees each one before the next. Throws OptionError for anything
// else.
std::vector<OptionAssignment> GivenOptions(
    const std::vector<std::string>& arguments,
    const std::vector<Option>& options,
    const std::function<void(const OptionAssignment&)>& check);

// The options of a project file in COLMAP's INI format. Throws OptionError if
// it cannot be read.
std::vector<OptionAssignment> ReadProjectFile(
    const std::string& path, const std::vector<Option>& options);

}  // namespace krot::internal
