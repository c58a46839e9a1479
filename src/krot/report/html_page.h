#pragma once

#include <string>

#include "krot/model.h"

namespace krot::internal {

// The report of a command that made `after` from `before`, or that compared
// the two, as one HTML page without references to anything outside of it.
//
// `report_json` is what --report_path writes; the page shows its numbers, and
// holds it as it is in the element #krot-report. Keys that it lacks are not
// shown. The models go into #krot-models (html_model_view.h): all images, at
// most kMaxShownPoints points each, and the distribution of all true pixel
// errors. Byte sequences that are not UTF-8 are replaced.
//
// `crops_json` goes into #krot-crops: photos of suspects (SuspectCropsJson), []
// without. `pairs_json` goes into #krot-pairs: PairViewJson's text, with photos
// where there are some, null without.
//
// Requires valid models (ValidateModel). O(observations log observations); the
// same text at any number of threads.
std::string HtmlPage(const std::string& report_json, const Model& before,
                     const Model& after, int num_threads = -1,
                     const std::string& crops_json = "[]",
                     const std::string& pairs_json = "null");

}  // namespace krot::internal
