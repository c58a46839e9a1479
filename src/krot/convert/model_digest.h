#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "krot/model.h"

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

// SHA-256, in 64 lower-case hexadecimal digits, of what a certificate speaks
// about: cameras, rotations, places in rigs and observations. Translations of
// frames and points, which a solver changes, do not enter, nor does the format
// or the order of the files. The bytes are defined in docs/formats.md.
// Requires a valid model. O(2D points); keeps no copy of the bytes.
std::string ModelSha256(const Model& model);

// Of any bytes, written likewise.
std::string Sha256(std::string_view bytes);

}  // namespace krot::internal
