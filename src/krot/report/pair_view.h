#pragma once

#include "krot/database.h"
#include "krot/model.h"
#include "krot/report/report_json.h"

namespace krot::internal {

// Images on the report page: their longer side, pixels.
inline constexpr int kPairViewSide = 480;

// What the page draws of the matches of pairs of images. `images`, in the order
// of the report's: width and height there, and jpeg, null until a photo comes.
// `matches`, of each pair a list of up to 100 (of kept pairs 30), evenly from
// all: x and y in both images, and 1 if the match agrees with the poses, else
// 0. `check` is CheckPairs' of the two. O(matches).
Json PairViewJson(const Model& model, const Database& database,
                  const PairCheck& check);

}  // namespace krot::internal
