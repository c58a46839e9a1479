#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace krot {

// A report that cannot be written; what() is one sentence.
class WriteError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Throws WriteError if WriteFileAtomically would fail for want of a folder
// (unless that is `folder_to_come`, which will exist by then), of permission,
// or because something other than a regular file stands there. Changes
// nothing.
void CheckFileWritable(const std::filesystem::path& file,
                       const std::filesystem::path& folder_to_come = {});

// Writes a new file beside `file` and renames it, so that an interruption
// leaves the old file or the new one. Throws WriteError.
void WriteFileAtomically(const std::filesystem::path& file,
                         const std::string& contents);

}  // namespace krot
