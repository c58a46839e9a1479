#pragma once

#include <array>
#include <cstdint>

#include "krot/model.h"
#include "krot/outliers/outlier_filter.h"

namespace krot::internal {

// Colours that colour-blind eyes tell apart, too [Okabe and Ito].
inline constexpr std::array<uint8_t, 3> kRemovedColor = {213, 94, 0};
inline constexpr std::array<uint8_t, 3> kConflictColor = {0, 114, 178};
inline constexpr std::array<uint8_t, 3> kUnsuspectedColor = {190, 190, 190};

// For COLMAP's GUI: every point of the model that was filtered bears a colour:
// vermilion if an observation of its track was removed, blue if its track only
// takes part in a conflict, otherwise light grey. O(points + conflicts).
void ColorSuspects(const OutlierFilterSummary& summary, Model* model);

}  // namespace krot::internal
