#include "krot/report/html_base64.h"

#include <algorithm>
#include <cstdint>

namespace krot::internal {
namespace {

constexpr char kDigits[] =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

}  // namespace

std::string Base64(const unsigned char* bytes, size_t size) {
  std::string text;
  text.reserve((size + 2) / 3 * 4);
  for (size_t i = 0; i < size; i += 3) {
    const size_t num_bytes = std::min<size_t>(3, size - i);
    uint32_t bits = 0;
    for (size_t k = 0; k < 3; ++k) {
      bits = bits << 8 | (k < num_bytes ? bytes[i + k] : 0u);
    }
    for (size_t k = 0; k < 4; ++k) {
      const uint32_t digit = bits >> (18 - 6 * k) & 63u;
      text += k <= num_bytes ? kDigits[digit] : '=';
    }
  }
  return text;
}

}  // namespace krot::internal
