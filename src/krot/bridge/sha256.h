#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace krot::internal {

// SHA-256 (FIPS 180-4), about 200 MB/s.
class Sha256Stream {
 public:
  Sha256Stream();

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

}  // namespace krot::internal
