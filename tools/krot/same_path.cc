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
  // What does not exist is the same by its name, in folders that are the same.
  while (x != y) {
    std::error_code error;
    // Also where names differ in case alone and the file system does not care,
    // and where weakly_canonical() follows no links, as by mingw-w64.
    if (fs::equivalent(x, y, error) && !error) return true;
    if (fs::exists(x, error) || fs::exists(y, error)) return false;
    if (x.filename() != y.filename() || !x.has_relative_path()) return false;
    x = x.parent_path();
    y = y.parent_path();
  }
  return true;
}

}  // namespace krot::internal
