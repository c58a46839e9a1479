#include "tests/architecture/source_tree.h"

#include <algorithm>
#include <fstream>
#include <iterator>
#include <regex>
#include <stdexcept>

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

bool IsSource(const fs::path& file) {
  return file.extension() == ".h" || file.extension() == ".cc";
}

bool IsText(const fs::path& file) {
  static const std::vector<std::string> kExtensions = {
      ".h", ".cc", ".cmake", ".in", ".json", ".md", ".py", ".sh", ".txt"};
  return std::find(kExtensions.begin(), kExtensions.end(), file.extension()) !=
         kExtensions.end();
}

// Blanks string literals and comments that end on their line.
std::string StripStringsAndComments(const std::string& line) {
  static const std::regex kString(R"("(\\.|[^"\\])*")");
  static const std::regex kComment(R"(//.*|/\*.*?\*/)");
  return std::regex_replace(std::regex_replace(line, kString, "\"\""), kComment,
                            "");
}

void AppendLines(const fs::path& file, std::vector<SourceLine>* lines) {
  std::ifstream stream(fs::path(KROT_SOURCE_DIR) / file);
  if (!stream) throw std::runtime_error("cannot read " + file.string());
  std::string text;
  for (int number = 1; std::getline(stream, text); ++number) {
    lines->push_back({file, number, text});
  }
}

}  // namespace

std::vector<SourceLine> SourceLines(const std::string& folder) {
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry :
       fs::recursive_directory_iterator(fs::path(KROT_SOURCE_DIR) / folder)) {
    if (entry.is_regular_file() && IsSource(entry.path())) {
      files.push_back(fs::relative(entry.path(), KROT_SOURCE_DIR));
    }
  }
  std::sort(files.begin(), files.end());
  std::vector<SourceLine> lines;
  for (const fs::path& file : files) AppendLines(file, &lines);
  return lines;
}

std::vector<SourceLine> CodeLines(const std::string& folder) {
  std::vector<SourceLine> lines = SourceLines(folder);
  for (SourceLine& line : lines) {
    const bool is_include = line.text.rfind("#include", 0) == 0;
    if (!is_include) line.text = StripStringsAndComments(line.text);
  }
  return lines;
}

std::string LibraryFolder(const fs::path& file) {
  auto part = file.begin();
  std::advance(part, 2);  // src, krot
  return std::next(part) == file.end() ? "" : part->string();
}

std::vector<fs::path> ProjectFiles() {
  std::vector<fs::path> files;
  for (fs::recursive_directory_iterator entry(KROT_SOURCE_DIR), end;
       entry != end; ++entry) {
    const std::string name = entry->path().filename().string();
    if (entry->is_directory() &&
        (name == ".git" || name.rfind("build", 0) == 0)) {
      entry.disable_recursion_pending();
    } else if (entry->is_regular_file() && IsText(entry->path())) {
      files.push_back(fs::relative(entry->path(), KROT_SOURCE_DIR));
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace krot::internal
