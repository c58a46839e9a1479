#pragma once

#include <string>
#include <vector>

#include "krot/model.h"
#include "krot/model/file_bytes.h"

namespace krot::internal {

// COLMAP's text files (docs/formats.md). Numbers are written with the fewest
// digits that give the same bits back; a NaN keeps its sign but not its
// payload. Image names are the rest of their line and may hold blanks.
//
// Parse... replaces its part of the model; throws ModelError with the line,
// the word found and what was expected. Text holds no counts of records:
// duplicates and gaps are for ValidateModel. Format... returns the file's
// content; throws WriteError for what text cannot hold (an unknown camera
// model or sensor type, a name with line breaks or blanks at its ends).
// O(bytes), some 100 MB/s.

void ParseCamerasText(const FileBytes& file, Model* model);
void ParseRigsText(const FileBytes& file, Model* model);
void ParseFramesText(const FileBytes& file, Model* model);
void ParseImagesText(const FileBytes& file, Model* model);
void ParsePoints3DText(const FileBytes& file, Model* model);

std::string FormatCamerasText(const Model& model);
std::string FormatRigsText(const Model& model);
std::string FormatFramesText(const Model& model);
std::string FormatImagesText(const Model& model);
std::string FormatPoints3DText(const Model& model);

}  // namespace krot::internal
