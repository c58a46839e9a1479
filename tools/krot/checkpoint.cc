#include "tools/krot/checkpoint.h"

#include <filesystem>
#include <optional>

#include "krot/convert/certificate_file.h"
#include "krot/model/model_io.h"
#include "krot/pipeline/solve_model.h"
#include "krot/report/text_table.h"
#include "krot/version.h"
#include "tools/krot/interrupt.h"

namespace krot::internal {
namespace {

// When the steps that the file holds are used up, ends the run as an interrupt
// would.
class CheckpointAlone : public CheckpointFile {
 public:
  using CheckpointFile::CheckpointFile;

  std::optional<std::string> Next() override {
    std::optional<std::string> record = CheckpointFile::Next();
    if (!record) Interrupt();
    return record;
  }
};

template <typename T>
void AppendValues(const T& values, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(values.data()),
                sizeof(values[0]) * static_cast<size_t>(values.size()));
}

// The digest of where the solve starts, which a model's digest leaves out.
std::string StartDigest(const Model& model) {
  std::string bytes;
  for (const Frame& frame : model.frames) {
    AppendValues(frame.rig_from_world.translation, &bytes);
  }
  for (const Point3D& point : model.points3D) AppendValues(point.xyz, &bytes);
  return Sha256(bytes);
}

std::string FileDigest(const std::string& path) {
  return path.empty() ? "none" : Sha256(ReadFileBytes(path).bytes);
}

// The digest of all that the result depends on.
std::string RunDigest(const CheckpointOptions& options, const ModelPaths& paths,
                      const Model& model) {
  std::string text = "krot " KROT_VERSION "\n" + options.settings;
  text += ModelSha256(model) + "\n" + StartDigest(model) + "\n";
  for (const std::string* path :
       {&paths.fixed_images_path, &paths.fixed_points_path,
        &paths.positions_path, &paths.point_positions_path}) {
    text += FileDigest(*path) + "\n";
  }
  text += paths.positions_frame + "\n";
  return Sha256(text);
}

}  // namespace

void AddCheckpointPath(CheckpointOptions* options, OptionParser* parser) {
  parser->AddOutputFile("checkpoint_path", &options->path,
                        "Where completed steps are kept, so that the same "
                        "command goes on from there after a kill");
}

void AddCheckpointOnly(CheckpointOptions* options, OptionParser* parser) {
  parser->AddBool("checkpoint_only", &options->is_all,
                  "Only write the best estimate of the checkpoint");
}

void ResolveCheckpoint(const OptionParser& parser, CheckpointOptions* options) {
  if (options->path.empty()) {
    parser.Refuse("checkpoint_only", "without --checkpoint_path");
  }
  for (const Option& option : parser.options()) {
    const bool is_setting = option.name.find('.') != std::string::npos &&
                            option.name != "Solver.num_threads";
    if (!is_setting) continue;
    options->settings += option.name + "=" + parser.Text(option.name) + "\n";
  }
}

std::unique_ptr<Checkpoint> OpenCheckpoint(const CheckpointOptions& options,
                                           const ModelPaths& paths,
                                           const Model& model,
                                           const Context& context,
                                           const LogOptions& log) {
  if (options.path.empty()) return nullptr;
  if (context.ranks != nullptr && !context.ranks->IsFirst()) {
    return std::make_unique<Checkpoint>();
  }
  const std::string run = RunDigest(options, paths, model);
  std::unique_ptr<CheckpointFile> file;
  if (options.is_all) {
    file = std::make_unique<CheckpointAlone>(options.path, run);
  } else {
    file = std::make_unique<CheckpointFile>(options.path, run);
  }
  if (file->num_steps() > 0) {
    LogLine(log, 1,
            options.path + ": going on behind " +
                Counted(file->num_steps(), "step") + " of an earlier run");
  }
  return file;
}

void RemoveCheckpoint(const CheckpointOptions& options, const LogOptions& log) {
  std::error_code error;
  if (options.path.empty()) return;
  std::filesystem::remove(options.path, error);
  if (!error) return;
  LogLine(
      log, 0,
      "warning: " + options.path + " cannot be removed: " + error.message());
}

}  // namespace krot::internal
