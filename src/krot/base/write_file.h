#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>

#include "krot/context.h"

namespace krot::internal {

// An open file that is closed when it goes out of scope.
class FileDescriptor {
 public:
  explicit FileDescriptor(int value) : value_(value) {}
  ~FileDescriptor() {
    if (is_open()) ::close(value_);
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;

  bool is_open() const { return value_ >= 0; }
  int get() const { return value_; }
  // Returns false, with errno, if earlier writes did not reach the file.
  bool Close() {
    const int value = value_;
    value_ = -1;
    return ::close(value) == 0;
  }

 private:
  int value_;
};

// Why nothing can be created in `folder`; no error if something can. It is
// tried, since permissions tell root nothing of /proc or of a read-only disk;
// nothing stays.
std::error_code TryToCreateIn(const std::filesystem::path& folder);

// Throws WriteError if WriteFileAtomically would fail because there is no
// folder (unless that is `folder_to_come`, which will exist by then), no
// permission, or something other than a regular file in its place. Changes
// nothing.
void CheckFileWritable(const std::filesystem::path& file,
                       const std::filesystem::path& folder_to_come = {});

// Creates `file` or replaces its content, and forces it to the disk. Throws
// WriteError if it cannot be written in full.
void WriteFile(const std::filesystem::path& file, std::string_view contents);

// Does the same to a new file beside `file`, which is then renamed, so that an
// interruption leaves either the old file or the new one. Throws WriteError.
void WriteFileAtomically(const std::filesystem::path& file,
                         std::string_view contents);

// Forces the names that a folder holds to the disk, so that a rename outlasts a
// power cut. Does nothing for a folder that may not be read. Throws WriteError.
void SyncFolder(const std::filesystem::path& folder);

}  // namespace krot::internal
