#include "krot/model/model_io.h"

#include <cerrno>
#include <iterator>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "krot/base/write_file.h"
#include "krot/context.h"
#include "krot/model.h"
#include "krot/model/formats.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

[[noreturn]] void FailWithErrno(const std::string& path, const char* action) {
  const std::string reason = std::generic_category().message(errno);
  throw ModelError(path + ": cannot be " + action + ": " + reason);
}

}  // namespace

FileBytes ReadFileBytes(const std::filesystem::path& path) {
  FileBytes file;
  file.path = path.string();
  const FileDescriptor descriptor(path, FileDescriptor::Use::kRead);
  if (!descriptor.is_open()) FailWithErrno(file.path, "opened");

  const std::optional<int64_t> size = descriptor.RegularSize();
  if (!size) {
    throw ModelError(file.path + ": not a regular file, expected a model file");
  }
  if (!descriptor.ReadAt(0, static_cast<size_t>(*size), &file.bytes)) {
    FailWithErrno(file.path, "read");
  }

  if (file.bytes.rfind("version https://git-lfs.github.com/spec/", 0) == 0) {
    throw ModelError(file.path +
                     ": is a Git LFS pointer, not a model; run `git lfs pull` "
                     "where it was cloned");
  }
  return file;
}

namespace {

namespace fs = std::filesystem;

// One file of a model, in both formats.
struct ModelPart {
  const char* name;
  bool is_optional;  // rigs and frames
  void (*parse_binary)(const FileBytes& file, Model* model);
  void (*parse_text)(const FileBytes& file, Model* model);
  std::string (*format_binary)(const Model& model);
  std::string (*format_text)(const Model& model);

  std::string FileName(ModelFormat format) const {
    return std::string(name) +
           (format == ModelFormat::kBinary ? ".bin" : ".txt");
  }
  void Read(const fs::path& folder, ModelFormat format, Model* model) const {
    const auto parse =
        format == ModelFormat::kBinary ? parse_binary : parse_text;
    parse(ReadFileBytes(folder / FileName(format)), model);
  }
};

// The files in the order in which COLMAP reads them.
const ModelPart kParts[] = {
    {"cameras", false, ParseCamerasBinary, ParseCamerasText,
     FormatCamerasBinary, FormatCamerasText},
    {"rigs", true, ParseRigsBinary, ParseRigsText, FormatRigsBinary,
     FormatRigsText},
    {"frames", true, ParseFramesBinary, ParseFramesText, FormatFramesBinary,
     FormatFramesText},
    {"images", false, ParseImagesBinary, ParseImagesText, FormatImagesBinary,
     FormatImagesText},
    {"points3D", false, ParsePoints3DBinary, ParsePoints3DText,
     FormatPoints3DBinary, FormatPoints3DText},
};

// After cameras, rigs and frames.
const ModelPart* const kImages = kParts + 3;

constexpr ModelFormat kFormats[] = {ModelFormat::kBinary, ModelFormat::kText};

// Runs `action`, and turns a refusal of the file system into an Error.
template <typename Error, typename Action>
auto Translating(const fs::path& folder, const char* verb,
                 const Action& action) {
  try {
    return action();
  } catch (const fs::filesystem_error& error) {
    throw Error(folder.string() + ": cannot be " + verb + ": " +
                error.code().message());
  }
}

bool IsModelFile(const fs::path& file_name) {
  for (const ModelPart& part : kParts) {
    for (const ModelFormat format : kFormats) {
      if (file_name == part.FileName(format)) return true;
    }
  }
  return false;
}

// Names of the core files of this format that the folder holds (`present`) or
// lacks.
std::vector<std::string> CoreFiles(const fs::path& folder, ModelFormat format,
                                   bool present) {
  std::vector<std::string> names;
  for (const ModelPart& part : kParts) {
    const std::string name = part.FileName(format);
    if (!part.is_optional && fs::exists(folder / name) == present) {
      names.push_back(name);
    }
  }
  return names;
}

bool HoldsModel(const fs::path& folder) {
  return CoreFiles(folder, ModelFormat::kBinary, false).empty() ||
         CoreFiles(folder, ModelFormat::kText, false).empty();
}

std::string Join(const std::vector<std::string>& names) {
  std::string joined;
  for (const std::string& name : names) {
    joined += (joined.empty() ? "" : ", ") + name;
  }
  return joined;
}

[[noreturn]] void FailWithoutModel(const fs::path& folder) {
  std::string found = "no model file";
  std::string expected = "cameras, images and points3D, all .bin or all .txt";
  for (const ModelFormat format : kFormats) {
    const std::vector<std::string> names = CoreFiles(folder, format, true);
    if (names.empty()) continue;
    found = Join(names);
    expected = Join(CoreFiles(folder, format, false)) + " too";
    break;
  }
  std::string hint;
  for (const char* subfolder : {"0", "sparse/0", "sparse"}) {
    if (!HoldsModel(folder / subfolder)) continue;
    hint = "; " + (folder / subfolder).string() + " holds a model";
    break;
  }
  throw ModelError(folder.string() + ": found " + found + ", expected " +
                   expected + hint);
}

// Whether the folder holds rigs and frames; throws if it holds only one.
bool HasRigs(const fs::path& folder, ModelFormat format) {
  std::vector<std::string> present;
  std::vector<std::string> missing;
  for (const ModelPart& part : kParts) {
    if (!part.is_optional) continue;
    const std::string name = part.FileName(format);
    (fs::exists(folder / name) ? present : missing).push_back(name);
  }
  if (!present.empty() && !missing.empty()) {
    throw ModelError(folder.string() + ": found " + present[0] + " without " +
                     missing[0] + ", expected both or neither");
  }
  return missing.empty();
}

// Into `staging`, which becomes `folder`.
void WriteModelFiles(const Model& model, ModelFormat format,
                     const fs::path& staging, const fs::path& folder) {
  for (const ModelPart& part : kParts) {
    if (part.is_optional && !model.stores_rigs) continue;
    const auto format_part =
        format == ModelFormat::kBinary ? part.format_binary : part.format_text;
    const std::string name = part.FileName(format);
    WriteFile(staging / name, format_part(model), folder / name);
  }
}

}  // namespace

Model ReadWithoutImages(const fs::path& folder, ModelFormat format) {
  const bool has_rig_files = Translating<ModelError>(
      folder, "read", [&] { return HasRigs(folder, format); });
  Model model;
  for (const ModelPart* part = kParts; part != kImages; ++part) {
    if (part->is_optional && !has_rig_files) continue;
    part->Read(folder, format, &model);
  }
  return model;
}

void CompleteRigs(Model* model) {
  // Like COLMAP, treats a model with empty rigs and frames as a legacy one.
  model->stores_rigs = !model->rigs.empty() || !model->frames.empty();
  if (!model->stores_rigs) UseTrivialRigs(model);
}

std::vector<std::string> ImageNamesWithWhiteSpace(const Model& model) {
  std::vector<std::string> names;
  for (const Image& image : model.images) {
    if (image.name.find_first_of(" \t\r\n\v\f") != std::string::npos) {
      names.push_back(image.name);
    }
  }
  return names;
}

}  // namespace krot::internal

namespace krot {

using namespace internal;

ModelFormat DetectModelFormat(const fs::path& folder) {
  return Translating<ModelError>(folder, "read", [&] {
    if (!fs::exists(folder)) {
      throw ModelError(folder.string() + ": no such folder");
    }
    if (!fs::is_directory(folder)) {
      throw ModelError(folder.string() +
                       ": is a file, expected the folder of a model");
    }
    for (const ModelFormat format : kFormats) {
      if (CoreFiles(folder, format, false).empty()) return format;
    }
    FailWithoutModel(folder);
  });
}

Model ReadModel(const fs::path& folder, ModelFormat format) {
  Model model = ReadWithoutImages(folder, format);
  for (const ModelPart* part = kImages; part != std::end(kParts); ++part) {
    part->Read(folder, format, &model);
  }
  CompleteRigs(&model);
  return model;
}

Model ReadModel(const fs::path& folder) {
  Model model = ReadModel(folder, DetectModelFormat(folder));
  ValidateModel(model);
  return model;
}

void CheckWritable(const fs::path& folder, const WriteModelOptions& options) {
  Translating<WriteError>(folder, "written", [&] {
    CheckSwappable(folder);
    if (options.overwrite) return;
    for (const ModelPart& part : kParts) {
      for (const ModelFormat format : kFormats) {
        const std::string name = part.FileName(format);
        if (!fs::exists(folder / name)) continue;
        throw WriteError(folder.string() + ": already holds a model (" + name +
                         "); set overwrite to replace it");
      }
    }
  });
}

void WriteModel(const Model& model, const fs::path& folder,
                const WriteModelOptions& options) {
  CheckWritable(folder, options);
  Translating<WriteError>(folder, "written", [&] {
    FolderSwap swap(folder, options.on_note);
    WriteModelFiles(model, options.format, swap.staging(), folder);
    const fs::path project = options.copy_project_from / "project.ini";
    if (!options.copy_project_from.empty() && fs::exists(project)) {
      fs::copy_file(project, swap.staging() / project.filename());
    }
    swap.Commit(IsModelFile);
  });
  std::error_code ignored;
  // Splatting programs convert points3D.bin to this file and read it instead.
  const fs::path points = folder / "points3D.ply";
  if (!options.on_note || !fs::exists(points, ignored)) return;
  options.on_note(points.string() +
                  " is older than the model beside it, and splatting programs "
                  "read it instead of points3D: remove it, if it was made of "
                  "the old one");
}

}  // namespace krot
