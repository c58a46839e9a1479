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
  // Also where names differ in case alone and the file system does not care.
  if (fs::equivalent(a, b, error) && !error) return true;
  return Normal(a) == Normal(b);
}

}  // namespace krot::internal
