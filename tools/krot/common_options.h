#pragma once

#include <cstdint>
#include <string>

#include "tools/krot/log.h"
#include "tools/krot/option_parser.h"

namespace krot::internal {

// Options that every command takes.
struct CommonOptions {
  uint64_t random_seed = 0;
  LogOptions log;
  std::string project_path;
};

void AddLogLevel(LogOptions* log, OptionParser* parser);
void AddProjectPath(std::string* project_path, OptionParser* parser);
void AddCommonOptions(
    CommonOptions* options, OptionParser* parser,
    const char* of_seed =
        "Accepted everywhere; this command draws no random numbers");

}  // namespace krot::internal
