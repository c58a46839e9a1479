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
  bool is_all = false;   // only write its best estimate
  std::string settings;  // all that a result depends on, besides the files
};

void AddCheckpointPath(CheckpointOptions* options, OptionParser* parser);
void AddCheckpointOnly(CheckpointOptions* options, OptionParser* parser);

// To be called once options are parsed: fills in the settings. Throws
// OptionError where the options contradict each other.
void ResolveCheckpoint(const OptionParser& parser, CheckpointOptions* options);

// Opens the checkpoint of this run on the model that was read; null if there is
// none. With several processes (ranks) the first one has the file. Says how far
// an earlier run came. Throws CheckpointError, WriteError.
std::unique_ptr<Checkpoint> OpenCheckpoint(const CheckpointOptions& options,
                                           const ModelPaths& paths,
                                           const Model& model,
                                           const Context& context,
                                           const LogOptions& log);

// Removes the file once all output is written; warns if it cannot.
void RemoveCheckpoint(const CheckpointOptions& options, const LogOptions& log);

}  // namespace krot::internal
