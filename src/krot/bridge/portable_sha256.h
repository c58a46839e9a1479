#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace krot {

// SHA-256 (FIPS 180-4) where there is no OpenSSL, as in a browser: a third of
// its speed at most.
class PortableSha256 {
 public:
  PortableSha256();

  void Append(const unsigned char* bytes, size_t size);

  // Of all that was appended; nothing may be appended after it.
  std::array<unsigned char, 32> Finish();

 private:
  void DigestBlock();

  std::array<uint32_t, 8> state_;
  std::array<unsigned char, 64> block_;
  size_t block_size_ = 0;
  uint64_t num_bytes_ = 0;
};

}  // namespace krot
