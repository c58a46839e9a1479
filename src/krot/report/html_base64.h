#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace krot::internal {

// RFC 4648, with padding. O(size).
std::string Base64(const unsigned char* bytes, size_t size);

// Of the numbers' bytes as they lie in memory.
template <typename Number>
std::string Base64(const std::vector<Number>& numbers) {
  return Base64(reinterpret_cast<const unsigned char*>(numbers.data()),
                numbers.size() * sizeof(Number));
}

}  // namespace krot::internal
