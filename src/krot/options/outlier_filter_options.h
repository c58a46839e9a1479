#pragma once

#include "krot/options/option_table.h"
#include "krot/outliers/outlier_filter.h"

namespace krot::internal {

// The options of `outlier_filter`, without its paths.
void AddOutlierFilterOptions(OutlierFilterOptions* options, Context* context,
                             OptionTable* table);

// To be called after they are set: the method where none is given, which is
// conflicts with a bound or if something is asked for that needs them. Throws
// OptionError for options that would have no effect, or lack another.
void ResolveOutlierFilterOptions(const OptionTable& table, bool needs_conflicts,
                                 OutlierFilterOptions* options);

}  // namespace krot::internal
