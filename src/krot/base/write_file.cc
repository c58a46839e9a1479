#include "krot/base/write_file.h"

#include <cerrno>
#include <optional>
#include <system_error>

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

fs::path ParentFolder(const fs::path& file) {
  const fs::path parent = file.parent_path();
  return parent.empty() ? fs::path(".") : parent;
}

// An absolute path with a trailing slash, so that "out/" and "out" compare
// equal.
fs::path Normal(const fs::path& folder) {
  return (fs::absolute(folder) / "").lexically_normal();
}

// The action that failed on a file, and the reason.
struct Failure {
  const char* action;
  std::string reason;
};

Failure FailureOf(const char* action) {
  return {action, std::generic_category().message(errno)};
}

std::optional<Failure> TryToWrite(const fs::path& file,
                                  std::string_view contents) {
  FileDescriptor descriptor(file, FileDescriptor::Use::kReplace);
  if (!descriptor.is_open()) return FailureOf("created");
  if (!descriptor.Write(contents)) return FailureOf("written");
  // Some file systems report only at this point that there is no space left.
  if (!descriptor.Sync()) return FailureOf("written");
  if (!descriptor.Close()) return FailureOf("written");
  return std::nullopt;
}

}  // namespace

void CheckFileWritable(const fs::path& file, const fs::path& folder_to_come) {
  const fs::path folder = ParentFolder(file);
  std::error_code ignored;
  if (!file.has_filename() || fs::is_directory(file, ignored)) {
    throw WriteError(file.string() + " is a folder, expected a file name");
  }
  if (fs::exists(file, ignored) && !fs::is_regular_file(file, ignored)) {
    throw WriteError(file.string() + " exists and is not a regular file");
  }
  if (!folder_to_come.empty() && Normal(folder) == Normal(folder_to_come)) {
    return;
  }
  if (!fs::is_directory(folder, ignored)) {
    throw WriteError(file.string() + " cannot be written: there is no folder " +
                     folder.string());
  }
  if (const std::error_code error = TryToCreateIn(folder)) {
    throw WriteError(file.string() + " cannot be written: folder " +
                     folder.string() + " is not writable: " + error.message());
  }
}

void WriteFile(const fs::path& file, std::string_view contents) {
  if (const std::optional<Failure> failure = TryToWrite(file, contents)) {
    throw WriteError(file.string() + ": cannot be " + failure->action + ": " +
                     failure->reason);
  }
}

void WriteFileAtomically(const fs::path& file, std::string_view contents) {
  fs::path temporary = file;
  temporary += ".new-" + std::to_string(ProcessId());
  const auto fail = [&](std::string why) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    if (fs::exists(temporary, ignored)) {
      why += "; " + temporary.string() + " is left";
    }
    throw WriteError(file.string() + " cannot be written: " + why);
  };

  if (const std::optional<Failure> failure = TryToWrite(temporary, contents)) {
    fail(failure->reason);
  }
  std::error_code error;
  fs::rename(temporary, file, error);
  if (error) fail(error.message());
  SyncFolder(ParentFolder(file));
}

void SyncFolder(const fs::path& folder) {
  if (const std::error_code error = SyncEntries(folder)) {
    throw WriteError(folder.string() +
                     ": cannot be written: " + error.message());
  }
}

}  // namespace krot::internal
