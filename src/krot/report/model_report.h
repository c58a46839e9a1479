#pragma once

#include <string>

#include "krot/report/model_statistics.h"

namespace krot {

// For the terminal: COLMAP's figures under COLMAP's names, then KROT's. The
// images are the `max_images` with the largest errors.
std::string ModelTable(const ModelStatistics& statistics, int max_images);

// The same as JSON, with all images; the keys are listed in docs/cli.md.
std::string ModelJson(const ModelStatistics& statistics,
                      const std::string& version);

}  // namespace krot
