#pragma once

#include <string>

#include "krot/model.h"
#include "krot/model/file_bytes.h"

namespace krot::internal {

// COLMAP's binary files (docs/formats.md): little endian, packed, without
// magic or version. Bytes that COLMAP 3.8 to 4.x wrote are reproduced
// exactly.
//
// Parse... replaces its part of the model; throws ModelError with the byte
// offset if the file is truncated, holds a count larger than itself, a camera
// model that is unknown, or bytes after its last record. Format... returns
// the file's content. O(bytes), a few GB/s.

void ParseCamerasBinary(const FileBytes& file, Model* model);
void ParseRigsBinary(const FileBytes& file, Model* model);
void ParseFramesBinary(const FileBytes& file, Model* model);
void ParseImagesBinary(const FileBytes& file, Model* model);
void ParsePoints3DBinary(const FileBytes& file, Model* model);

std::string FormatCamerasBinary(const Model& model);
std::string FormatRigsBinary(const Model& model);
std::string FormatFramesBinary(const Model& model);
std::string FormatImagesBinary(const Model& model);
std::string FormatPoints3DBinary(const Model& model);

}  // namespace krot::internal
