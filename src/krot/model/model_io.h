#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "krot/model/model.h"

namespace krot {

enum class ModelFormat { kBinary, kText };

// The format that ReadModel takes in this folder: binary if all of
// cameras.bin, images.bin and points3D.bin exist, otherwise text if all three
// .txt files exist. Throws ModelError, naming what is missing; if a
// subfolder "0" holds a model, the message says so.
ModelFormat DetectModelFormat(const std::filesystem::path& folder);

// Reads cameras, rigs, frames (both optional, but only together), images and
// points3D, each file in one read. Every count is checked against the file's
// size before memory is reserved. Throws ModelError. The result is
// syntactically complete; ValidateModel says whether it is consistent.
// Rigs and frames that are both empty or missing mean a legacy model, as for
// COLMAP; it gets trivial ones (trivial_rigs.h).
Model ReadModel(const std::filesystem::path& folder, ModelFormat format);

struct WriteModelOptions {
  ModelFormat format = ModelFormat::kBinary;
  // A folder that already holds files with a model's names (any of them, in
  // either format) is replaced only if this is set.
  bool overwrite = false;
  // project.ini is copied from this folder, if there is one.
  std::filesystem::path copy_project_from;  // empty: nothing is copied
  // As FolderSwap's note: what is left behind, and why; also if it is a
  // points3D.ply, which does not belong to this model. May be empty.
  std::function<void(const std::string&)> on_note = {};
};

// Throws WriteError if WriteModel would refuse this folder: it holds a model
// and options.overwrite is false, it is a file, a mount point or the working
// directory, or it cannot be created or is not writable. Changes nothing.
void CheckWritable(const std::filesystem::path& folder,
                   const WriteModelOptions& options);

// Writes the model into a new sibling folder and swaps that in, so that an
// interruption leaves the old model or the new one and never a mix; foreign
// files already in `folder` are carried over, model files of the other format
// are not. Rigs and frames are written if model.stores_rigs. Throws WriteError;
// nothing has changed then. Requires a valid model (ValidateModel).
void WriteModel(const Model& model, const std::filesystem::path& folder,
                const WriteModelOptions& options);

// The image names that COLMAP's text reader would cut at their first white
// space, in the order of the images. KROT reads them whole; warn before
// writing them as text.
std::vector<std::string> ImageNamesWithWhiteSpace(const Model& model);

}  // namespace krot
