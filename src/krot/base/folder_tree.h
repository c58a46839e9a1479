#pragma once

#include <filesystem>
#include <system_error>
#include <vector>

namespace krot {

// std::filesystem's own ways end the process where memory ends.

// The names in a folder, in no order. Throws std::filesystem::filesystem_error.
std::vector<std::filesystem::path> FolderEntries(
    const std::filesystem::path& folder);

// Removes a file, or a folder with all that it holds, if there is one; follows
// no links. Throws nothing: returns the first failure, after which it goes on
// with the rest.
std::error_code RemoveTree(const std::filesystem::path& path);

}  // namespace krot
