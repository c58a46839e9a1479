#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace krot::internal {

// Debian's COLMAP, the judge of what KROT writes.

bool HasColmap();

// Runs `colmap arguments...`; false if it fails. Its words go to `log`.
bool RunColmap(const std::vector<std::string>& arguments,
               const std::filesystem::path& log);

}  // namespace krot::internal
