#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "tests/architecture/source_tree.h"

namespace krot::internal {
namespace {

// What each folder of src/krot may include besides itself, base, and what
// those folders may include. docs/architecture.md says why.
const std::map<std::string, std::set<std::string>>& DirectDependencies() {
  static const std::map<std::string, std::set<std::string>> kDependencies = {
      {"base", {}},
      {"geometry", {}},
      {"math", {}},
      {"linear", {}},
      {"minimax", {"math", "linear"}},
      {"problem", {"minimax", "geometry"}},
      {"conic", {"problem"}},
      {"sweeps", {"problem"}},
      {"verify", {"problem"}},
      {"proof", {"conic", "verify"}},
      {"joint", {"proof", "sweeps"}},
      {"finish", {"conic"}},
      {"camera", {"math"}},
      {"model", {"camera", "geometry"}},
      {"analysis", {"model", "minimax"}},
      {"synthetic", {"model"}},
      {"adjust", {"model", "conic"}},
      {"convert", {"model", "proof"}},
      {"pipeline", {"convert", "joint", "finish", "analysis", "adjust"}},
      {"outliers", {"pipeline"}},
      {"tolerance", {"pipeline"}},
      {"options", {"outliers", "tolerance"}},
      {"report", {"outliers", "tolerance", "pipeline", "analysis"}},
  };
  return kDependencies;
}

// All that `folder` may include, itself and base with it.
std::set<std::string> AllowedFolders(const std::string& folder) {
  std::set<std::string> allowed = {folder, "base"};
  for (const std::string& dependency : DirectDependencies().at(folder)) {
    allowed.merge(AllowedFolders(dependency));
  }
  return allowed;
}

// The places where `pattern` occurs in the code of `folder`, one per line.
std::string Occurrences(const std::string& folder, const std::string& pattern,
                        const std::set<std::string>& exempt_folders = {}) {
  const std::regex regex(pattern);
  std::ostringstream places;
  for (const SourceLine& line : CodeLines(folder)) {
    if (!std::regex_search(line.text, regex)) continue;
    if (exempt_folders.count(LibraryFolder(line.file)) > 0) continue;
    places << line.Place() << ": " << line.text << "\n";
  }
  return places.str();
}

TEST(IncludeRule, EveryFolderOfTheLibraryHasItsPlace) {
  for (const SourceLine& line : SourceLines("src/krot")) {
    if (line.number > 1 || LibraryFolder(line.file).empty()) continue;
    EXPECT_EQ(DirectDependencies().count(LibraryFolder(line.file)), 1u)
        << line.file << " stands in a folder that the rule does not know";
  }
}

TEST(IncludeRule, AFolderIncludesOnlyWhatStandsBelowIt) {
  const std::regex own_include(R"(^\s*#\s*include\s*["<]krot/([a-z]+)/)");
  int num_includes = 0;
  for (const SourceLine& line : SourceLines("src/krot")) {
    std::smatch match;
    if (!std::regex_search(line.text, match, own_include)) continue;
    ++num_includes;
    const std::string folder = LibraryFolder(line.file);
    if (folder.empty()) continue;
    EXPECT_EQ(AllowedFolders(folder).count(match[1]), 1u)
        << line.Place() << ": " << folder << " must not include " << match[1];
  }
  EXPECT_GT(num_includes, 0);
}

bool IsPublicHeader(const std::filesystem::path& file) {
  return LibraryFolder(file).empty() && file.extension() == ".h";
}

TEST(PublicFace, HasAtMostFourteenHeaders) {
  int num_headers = 1;  // version.h, which is generated
  for (const SourceLine& line : SourceLines("src/krot")) {
    if (line.number == 1 && IsPublicHeader(line.file)) ++num_headers;
  }
  EXPECT_GT(num_headers, 1);
  EXPECT_LE(num_headers, 14);
}

TEST(PublicFace, IncludesNoFolderAndOfOthersEigenAlone) {
  const std::regex include(R"(^\s*#\s*include\s*([<"][^>"]*[>"]))");
  const std::regex allowed(R"("krot/[a-z_]+\.h"|<Eigen/[A-Za-z]+>|<[a-z]+>)");
  int num_includes = 0;
  for (const SourceLine& line : SourceLines("src/krot")) {
    std::smatch match;
    if (!IsPublicHeader(line.file)) continue;
    if (!std::regex_search(line.text, match, include)) continue;
    ++num_includes;
    EXPECT_TRUE(std::regex_match(match[1].str(), allowed))
        << line.Place() << ": " << match[1];
  }
  EXPECT_GT(num_includes, 0);
}

// docs/cpp.md has a section for each.
TEST(PublicFace, IsDocumentedHeaderByHeader) {
  std::ifstream stream(std::filesystem::path(KROT_SOURCE_DIR) / "docs/cpp.md");
  std::string headings;
  for (std::string text; std::getline(stream, text);) {
    if (text.rfind("## ", 0) == 0) headings += text + "\n";
  }
  for (const SourceLine& line : SourceLines("src/krot")) {
    if (line.number > 1 || !IsPublicHeader(line.file)) continue;
    const std::string header = "`krot/" + line.file.filename().string() + "`";
    EXPECT_NE(headings.find(header), std::string::npos) << header;
  }
}

// Adds the file and all that it includes of the library, directly or not.
void AddIncluded(const std::string& file, std::set<std::string>* included) {
  if (!included->insert(file).second) return;
  const std::regex own_include(R"(^\s*#\s*include\s*["<](krot/[^">]+)[">])");
  std::ifstream stream(std::filesystem::path(KROT_SOURCE_DIR) / "src" / file);
  EXPECT_TRUE(stream.is_open()) << file;
  std::smatch match;
  for (std::string text; std::getline(stream, text);) {
    if (std::regex_search(text, match, own_include)) {
      AddIncluded(match[1], included);
    }
  }
}

// What judges a proof has nothing in common with what finds it.
TEST(IncludeRule, TheCertificatesCheckerSeesNothingOfTheSolvers) {
  std::set<std::string> included;
  for (const SourceLine& line : SourceLines("src/krot/verify")) {
    if (line.number > 1) continue;
    AddIncluded(line.file.lexically_relative("src").generic_string(),
                &included);
  }
  EXPECT_EQ(included.count("krot/problem/known_rotation_problem.h"), 1u);
  std::set<std::string> of_baselines;
  AddIncluded("krot/convert/certificate_file.h", &of_baselines);
  AddIncluded("krot/convert/baseline_certificate.cc", &of_baselines);
  for (const std::string& file : of_baselines) {
    EXPECT_NE(file.rfind("krot/analysis/", 0), 0u)
        << "the checker of baselines must not include " << file;
  }
  for (const std::string& file : included) {
    for (const char* folder : {"linear", "conic", "joint", "sweeps"}) {
      EXPECT_NE(file.rfind(std::string("krot/") + folder + "/", 0), 0u)
          << "the checker must not include " << file;
    }
  }
}

TEST(IncludeRule, TheLibraryNamesItsHeadersFromTheSourceRoot) {
  EXPECT_EQ(Occurrences("src/krot", R"(#\s*include\s*"(?!krot/))"), "");
}

TEST(IncludeRule, TheLibraryIncludesNeitherTestsNorTools) {
  EXPECT_EQ(Occurrences("src/krot", R"(#\s*include\s*["<](tests|tools)/)"), "");
}

TEST(IncludeRule, OnlyToolsSeeProgramOptions) {
  EXPECT_EQ(Occurrences("src/krot", R"(program_options)"), "");
}

TEST(IncludeRule, OnlyAdjustSeesCeres) {
  EXPECT_EQ(Occurrences("src/krot", R"(#\s*include\s*["<]ceres/)", {"adjust"}),
            "");
}

TEST(LibraryCode, DoesNotPrint) {
  EXPECT_EQ(Occurrences("src/krot",
                        R"(\bstd::(cout|cerr|clog)\b|<iostream>|)"
                        R"(\b(printf|fprintf|puts|putchar|fputs|perror)\s*\()"),
            "");
}

TEST(LibraryCode, DoesNotEndTheProcess) {
  EXPECT_EQ(Occurrences("src/krot",
                        R"(\b(exit|_exit|quick_exit|abort|terminate)\s*\()"),
            "");
}

// Folders define what the public headers declare, and nothing else, in krot.
TEST(LibraryCode, OfFoldersIsInternal) {
  EXPECT_EQ(
      Occurrences("src/krot", R"(^\s*using\s+namespace\b(?!\s+internal;))"),
      "");
  for (const SourceLine& line : CodeLines("src/krot")) {
    if (line.text.rfind("namespace krot", 0) != 0) continue;
    const bool is_internal =
        line.text.rfind("namespace krot::internal {", 0) == 0 ||
        line.text.rfind("namespace krot::internal::KROT_UNITS {", 0) == 0;
    if (LibraryFolder(line.file).empty()) {
      EXPECT_FALSE(is_internal) << line.Place();
    } else if (line.file.extension() == ".h") {
      EXPECT_TRUE(is_internal) << line.Place();
    }
  }
}

TEST(SourceFiles, AreShortEnoughToReadInOneGo) {
  constexpr int kMaxLines = 400;
  for (const char* folder : {"src/krot", "tools"}) {
    for (const SourceLine& line : SourceLines(folder)) {
      EXPECT_NE(line.number, kMaxLines + 1)
          << line.file << " has more than " << kMaxLines << " lines";
    }
  }
}

TEST(SourceFiles, AreHeadersIncludedOnce) {
  std::map<std::string, bool> has_pragma_once;
  for (const SourceLine& line : SourceLines("src/krot")) {
    if (line.file.extension() != ".h") continue;
    bool& found = has_pragma_once[line.file.generic_string()];
    found = found || line.text == "#pragma once";
  }
  for (const auto& [file, found] : has_pragma_once) {
    EXPECT_TRUE(found) << file;
  }
}

// Absolute paths of one machine work on that machine only.
TEST(ProjectText, HoldsNoPathOfSomebodysMachine) {
  const std::regex machine_path(R"((^|[\s"'=(:])/(home|root|work|Users)/\w)");
  for (const std::filesystem::path& file : ProjectFiles()) {
    std::ifstream stream(std::filesystem::path(KROT_SOURCE_DIR) / file);
    std::string text;
    for (int number = 1; std::getline(stream, text); ++number) {
      EXPECT_FALSE(std::regex_search(text, machine_path))
          << file << ":" << number << ": " << text;
    }
  }
}

}  // namespace
}  // namespace krot::internal
