#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace krot::internal {

struct ProcessResult {
  int exit_code = 0;   // -n if signal n ended it; 127 if it was not found
  double seconds = 0;  // wall clock, start to exit
};

// Runs a program, found as a shell would, with nothing on its stdin and its
// output thrown away. Programs that could open a window are told not to
// (QT_QPA_PLATFORM=offscreen). Throws std::runtime_error if no process can be
// made.
ProcessResult RunProcess(const std::vector<std::string>& arguments);

// A new folder for temporary files; it and all in it go with the object.
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

// The executable `name` in the folder of the running one.
std::string SiblingExecutable(const std::string& name);

}  // namespace krot::internal
