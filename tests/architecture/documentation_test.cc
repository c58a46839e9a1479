#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/architecture/source_tree.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

struct Link {
  fs::path file;       // where it stands, relative to the project
  std::string target;  // as written
};

struct Documents {
  std::map<fs::path, std::set<std::string>> anchors;  // by file
  std::vector<Link> links;                            // within the project
};

// What GitHub makes of a heading.
std::string Anchor(const std::string& heading) {
  std::string anchor;
  for (const char c :
       std::regex_replace(heading, std::regex(R"(\]\([^)]*\))"), "]")) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) || byte >= 0x80 || c == '-' || c == '_') {
      anchor += static_cast<char>(std::tolower(byte));
    } else if (c == ' ') {
      anchor += '-';
    }
  }
  return anchor;
}

Documents ReadDocuments() {
  const std::regex heading(R"(^#+ +(.*\S)\s*$)");
  const std::regex link(R"(\]\(([^()\s]+)\))");
  Documents documents;
  for (const fs::path& file : ProjectFiles()) {
    if (file.extension() != ".md") continue;
    std::ifstream stream(fs::path(KROT_SOURCE_DIR) / file);
    bool is_code = false;
    for (std::string line; std::getline(stream, line);) {
      if (line.rfind("```", 0) == 0) is_code = !is_code;
      if (is_code) continue;
      std::smatch match;
      if (std::regex_match(line, match, heading)) {
        documents.anchors[file].insert(Anchor(match[1]));
      }
      for (std::sregex_iterator it(line.begin(), line.end(), link), end;
           it != end; ++it) {
        const std::string target = (*it)[1];
        if (target.find("://") == std::string::npos) {
          documents.links.push_back({file, target});
        }
      }
    }
  }
  return documents;
}

TEST(Documentation, EveryLinkWithinTheProjectLeadsSomewhere) {
  const Documents documents = ReadDocuments();
  EXPECT_GT(documents.links.size(), 50u);
  for (const Link& link : documents.links) {
    SCOPED_TRACE(link.file.generic_string() + " links to " + link.target);
    const size_t hash = link.target.find('#');
    const std::string path = link.target.substr(0, hash);
    const fs::path target =
        path.empty() ? link.file
                     : (link.file.parent_path() / path).lexically_normal();
    EXPECT_TRUE(fs::exists(fs::path(KROT_SOURCE_DIR) / target));
    if (hash == std::string::npos) continue;
    const auto anchors = documents.anchors.find(target);
    ASSERT_NE(anchors, documents.anchors.end());
    EXPECT_EQ(anchors->second.count(link.target.substr(hash + 1)), 1u);
  }
}

}  // namespace
}  // namespace krot::internal
