#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace krot::internal {

// A file in memory, and its name for messages.
struct FileBytes {
  std::string path;
  std::string bytes;
};

// Takes a sentence on how a file was understood, on what was skipped, for one;
// may be empty.
using FileNote = std::function<void(const std::string& sentence)>;

// The whole file in one read. Throws ModelError if it is missing, not a
// regular file or not readable, or if it is a Git LFS pointer instead of the
// file that it stands for.
FileBytes ReadFileBytes(const std::filesystem::path& path);

}  // namespace krot::internal
