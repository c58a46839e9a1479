#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

namespace krot {

// A model, report or certificate that cannot be written; what() is one
// sentence.
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

// Creates `file` or replaces its content, and forces it to the disk. Throws
// WriteError if it cannot be written in full (no space left, for one).
void WriteFile(const std::filesystem::path& file, std::string_view contents);

// The same to a new file beside `file`, which is then renamed, so that an
// interruption leaves the old file or the new one. Throws WriteError.
void WriteFileAtomically(const std::filesystem::path& file,
                         std::string_view contents);

}  // namespace krot
