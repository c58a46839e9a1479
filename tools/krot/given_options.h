#pragma once

#include <functional>
#include <string>
#include <vector>

#include "krot/options/option_table.h"

namespace krot::internal {

// What `--name value` and `--name=value` say, in their order; `check` sees each
// before the next is looked at. Throws OptionError for what is neither.
std::vector<OptionAssignment> GivenOptions(
    const std::vector<std::string>& arguments,
    const std::vector<Option>& options,
    const std::function<void(const OptionAssignment&)>& check);

// What a project file, in COLMAP's INI format, says. Throws OptionError if it
// cannot be read.
std::vector<OptionAssignment> ReadProjectFile(
    const std::string& path, const std::vector<Option>& options);

}  // namespace krot::internal
