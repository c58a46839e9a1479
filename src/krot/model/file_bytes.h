#pragma once

#include <filesystem>
#include <string>
#include <string_view>

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

// Creates `path` or replaces its content, and forces it to the disk. Throws
// ModelError if it cannot be written in full (no space left, for one).
void WriteFileBytes(const std::filesystem::path& path, std::string_view bytes);

}  // namespace krot
