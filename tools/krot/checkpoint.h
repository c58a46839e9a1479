#pragma once

#include <memory>
#include <string>

#include "krot/base/checkpoint.h"
#include "tools/krot/model_files.h"
#include "tools/krot/option_parser.h"

namespace krot::internal {

// The options of a command that can go on where it was killed.
struct CheckpointOptions {
  std::string path;      // "": none is kept
  bool is_all = false;   // nothing is solved beyond it
  std::string settings;  // all that a result depends on but the files
};

void AddCheckpointPath(CheckpointOptions* options, OptionParser* parser);
void AddCheckpointOnly(CheckpointOptions* options, OptionParser* parser);

// Once parsed: fills in the settings. Throws OptionError where the options
// contradict each other.
void ResolveCheckpoint(const OptionParser& parser, CheckpointOptions* options);

// The checkpoint of this run on the model that was read, null for none; of
// ranks the first one has the file. Says how far it came. Throws
// CheckpointError, WriteError.
std::unique_ptr<Checkpoint> OpenCheckpoint(const CheckpointOptions& options,
                                           const ModelPaths& paths,
                                           const Model& model,
                                           const Context& context,
                                           const LogOptions& log);

// Once all is written. Says what is left.
void RemoveCheckpoint(const CheckpointOptions& options, const LogOptions& log);

}  // namespace krot::internal
