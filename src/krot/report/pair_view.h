#pragma once

#include "krot/database.h"
#include "krot/model.h"
#include "krot/report/report_json.h"

namespace krot::internal {

// Images on the report page: their longer side, pixels.
inline constexpr int kPairViewSide = 480;

// What the page draws of the matches of pairs of images (docs/formats.md): all
// images with the size that they have there, without photos, and of every pair
// some of its matches, evenly from its list, with whether they agree with the
// poses. `check` is CheckPairs' of the two. O(matches).
Json PairViewJson(const Model& model, const Database& database,
                  const PairCheck& check);

}  // namespace krot::internal
