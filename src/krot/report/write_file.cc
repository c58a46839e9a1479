#include "krot/report/write_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

namespace krot {
namespace {

namespace fs = std::filesystem;

fs::path ParentFolder(const fs::path& file) {
  const fs::path parent = file.parent_path();
  return parent.empty() ? fs::path(".") : parent;
}

// As a folder: "out/" and "out" are the same.
fs::path Normal(const fs::path& folder) {
  return (fs::absolute(folder) / "").lexically_normal();
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
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    throw WriteError(file.string() + " cannot be written: folder " +
                     folder.string() + " is not writable");
  }
}

void WriteFileAtomically(const fs::path& file, const std::string& contents) {
  fs::path temporary = file;
  temporary += ".new-" + std::to_string(getpid());
  const auto fail = [&](const std::string& why) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw WriteError(file.string() + " cannot be written: " + why);
  };

  std::ofstream stream(temporary, std::ios::binary);
  stream << contents;
  stream.close();
  if (!stream) fail(std::strerror(errno));
  std::error_code error;
  fs::rename(temporary, file, error);
  if (error) fail(error.message());
}

}  // namespace krot
