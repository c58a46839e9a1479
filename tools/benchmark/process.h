#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace krot::internal {

struct ProcessResult {
  int exit_code = 0;   // -n if ended by signal n; 127 if it was not found
  double seconds = 0;  // wall clock, start to exit
};

// Runs a program, which is searched as a shell would, with an empty stdin and
// its output discarded. Qt programs do not open windows
// (QT_QPA_PLATFORM=offscreen). Throws std::runtime_error if no process can be
// created.
ProcessResult RunProcess(const std::vector<std::string>& arguments);

// A new folder for temporary files; the destructor removes it with all files.
class ScratchFolder {
 public:
  ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder();

  std::string operator/(const std::string& name) const {
    return (path_ / name).string();
  }

 private:
  std::filesystem::path path_;
};

// The executable `name` in the folder of the running executable.
std::string SiblingExecutable(const std::string& name);

}  // namespace krot::internal
