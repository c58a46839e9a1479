#pragma once

#include <cstdint>
#include <string>

#include "tools/log.h"
#include "tools/option_parser.h"

namespace krot {

// What every command takes.
struct CommonOptions {
  uint64_t random_seed = 0;
  LogOptions log;
  std::string project_path;
};

void AddCommonOptions(const std::string& seed_description,
                      CommonOptions* options, OptionParser* parser);

}  // namespace krot
