#pragma once

#include <string>

#include "krot/database.h"
#include "krot/model.h"
#include "krot/outliers/outlier_filter.h"
#include "tools/krot/log.h"

namespace krot::internal {

// What the report page shows of the photos in a folder. For the removed
// observations at the head of the summary's list, one per track, it has the
// photos of the whole track around its 2D points, and where the result's point
// projects. Photos are decoded one at a time; those that cannot be read are
// left out, and a line on stderr counts them. The result is a JSON array: each
// observation has image_name, point2D_idx, point3D_id and views, itself first.
// A view has image_name, point2D_idx and crop: null, or jpeg (base64), size (of
// its sides, pixels of the photo), observed and projected (in the crop's
// pixels; the latter is null if the point was removed or does not project).
std::string SuspectCropsJson(const std::string& image_path, const Model& input,
                             const Model& result,
                             const OutlierFilterSummary& summary,
                             const LogOptions& log);

// The text of PairViewJson, with the photos of all images that have pairs.
std::string PairViewWithPhotos(const std::string& image_path,
                               const Model& model, const Database& database,
                               const PairCheck& check, const LogOptions& log);

}  // namespace krot::internal
