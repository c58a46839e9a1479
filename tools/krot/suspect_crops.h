#pragma once

#include <string>

#include "krot/model.h"
#include "krot/outliers/outlier_filter.h"
#include "tools/krot/log.h"

namespace krot::internal {

// What the report page shows of the photos in a folder: of the removed
// observations in the front of the summary's list, one per track, the photos of
// the whole track around its 2D points, and where the result's point projects.
// As JSON (docs/formats.md). Photos are decoded one at a time; those that
// cannot be read are left out, which a line on stderr counts.
std::string SuspectCropsJson(const std::string& image_path, const Model& input,
                             const Model& result,
                             const OutlierFilterSummary& summary,
                             const LogOptions& log);

}  // namespace krot::internal
