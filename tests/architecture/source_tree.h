#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace krot::internal {

// The project's own files, as the architecture tests see them.

struct SourceLine {
  std::filesystem::path file;  // relative to the project
  int number = 0;              // from 1
  std::string text;

  std::string Place() const {
    return file.generic_string() + ":" + std::to_string(number);
  }
};

// All lines of the .h and .cc files in a folder of the project and below,
// files in alphabetical order. Throws if there is no such folder.
std::vector<SourceLine> SourceLines(const std::string& folder);

// The same without comments and string literals.
std::vector<SourceLine> CodeLines(const std::string& folder);

// The folder of src/krot that a file in it belongs to: "model" for
// src/krot/model/rigs.h, and "" for what stands in src/krot itself.
std::string LibraryFolder(const std::filesystem::path& file);

// All files that are under version control or would be: every text file of the
// project outside of build directories. Relative to the project.
std::vector<std::filesystem::path> ProjectFiles();

}  // namespace krot::internal
