#include "tools/krot/same_path.h"

#include <filesystem>
#include <system_error>

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

fs::path Normal(const std::string& path) {
  std::error_code ignored;
  return (fs::weakly_canonical(fs::absolute(path, ignored), ignored) / "")
      .lexically_normal();
}

}  // namespace

bool IsSamePath(const std::string& a, const std::string& b) {
  if (a.empty() || b.empty()) return false;
  std::error_code error;
  // This is also true if names differ only in case, and the file system ignores
  // it.
  if (fs::equivalent(a, b, error) && !error) return true;
  return Normal(a) == Normal(b);
}

}  // namespace krot::internal
