#pragma once

#include <filesystem>
#include <string>

namespace krot {

// A file in memory, and its name for messages.
struct FileBytes {
  std::string path;
  std::string bytes;
};

// The whole file in one read. Throws ModelError if it is missing, not a
// regular file or not readable, or if it is a Git LFS pointer instead of the
// file that it stands for.
FileBytes ReadFileBytes(const std::filesystem::path& path);

}  // namespace krot
