#pragma once

#include <string>
#include <string_view>

#include "krot/model.h"

namespace krot::internal {

// SHA-256, as 64 lower-case hexadecimal digits, of everything that a
// certificate depends on: cameras, rotations, poses in rigs, and observations.
// It does not depend on translations of frames and points, which a solver
// changes, nor on the format or order of the files. docs/formats.md defines the
// bytes. Requires a valid model. O(2D points); keeps no copy of the bytes.
std::string ModelSha256(const Model& model);

// SHA-256 (FIPS 180-4) of any bytes, in the same digits; about 200 MB/s.
std::string Sha256(std::string_view bytes);

}  // namespace krot::internal
