#pragma once

#include <string>
#include <string_view>

#include "krot/model.h"

namespace krot::internal {

// SHA-256, in 64 lower-case hexadecimal digits, of what a certificate speaks
// about: cameras, rotations, places in rigs and observations. Translations of
// frames and points, which a solver changes, do not enter, nor does the format
// or the order of the files. The bytes are defined in docs/formats.md.
// Requires a valid model. O(2D points); keeps no copy of the bytes.
std::string ModelSha256(const Model& model);

// Of any bytes, written likewise.
std::string Sha256(std::string_view bytes);

}  // namespace krot::internal
