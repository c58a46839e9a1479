#pragma once

#include <string>

namespace krot::internal {

// In quotes, with those that it holds twice.
inline std::string CsvText(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += c;
    quoted += c;
  }
  return quoted + "\"";
}

}  // namespace krot::internal
