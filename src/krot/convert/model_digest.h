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

  // The digest of everything that was appended; must be the last call.
  std::array<unsigned char, 32> Finish();

 private:
  void DigestBlock();

  std::array<uint32_t, 8> state_;
  std::array<unsigned char, 64> block_;
  size_t block_size_ = 0;
  uint64_t num_bytes_ = 0;
};

// SHA-256, as 64 lower-case hexadecimal digits, of everything that a
// certificate depends on: cameras, rotations, poses in rigs, and observations.
// It does not depend on translations of frames and points, which a solver
// changes, nor on the format or order of the files. docs/formats.md defines the
// bytes. Requires a valid model. O(2D points); keeps no copy of the bytes.
std::string ModelSha256(const Model& model);

// SHA-256 of any bytes, in the same digits.
std::string Sha256(std::string_view bytes);

}  // namespace krot::internal
