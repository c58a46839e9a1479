#include "tools/krot/same_path.h"

#include <filesystem>
#include <system_error>

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

// Absolute and without a slash at the end.
fs::path Normal(const std::string& path) {
  std::error_code ignored;
  return (fs::weakly_canonical(fs::absolute(path, ignored), ignored) / "")
      .lexically_normal()
      .parent_path();
}

}  // namespace

bool IsSamePath(const std::string& a, const std::string& b) {
  if (a.empty() || b.empty()) return false;
  fs::path x = Normal(a);
  fs::path y = Normal(b);
  // Paths that do not exist are the same if their names are, in folders that
  // are the same.
  while (x != y) {
    std::error_code error;
    // This is also true if names differ only in case, and the file system
    // ignores it; and for links, which mingw-w64's weakly_canonical does not
    // follow.
    if (fs::equivalent(x, y, error) && !error) return true;
    if (fs::exists(x, error) || fs::exists(y, error)) return false;
    if (x.filename() != y.filename() || !x.has_relative_path()) return false;
    x = x.parent_path();
    y = y.parent_path();
  }
  return true;
}

}  // namespace krot::internal
