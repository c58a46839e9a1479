#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

namespace krot {

// A model, report or certificate that cannot be written; what() is one
// sentence.
class WriteError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Why nothing can be created in `folder`; no error if something can. It is
// tried, since permissions tell root nothing of /proc or of a read-only disk;
// nothing stays.
std::error_code TryToCreateIn(const std::filesystem::path& folder);

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

// Forces the names that a folder holds to the disk, as a rename needs it to
// outlast a power cut; a folder that may not be read is left to the system.
// Throws WriteError.
void SyncFolder(const std::filesystem::path& folder);

}  // namespace krot
