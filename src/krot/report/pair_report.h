#pragma once

#include <string>

#include "krot/database.h"
#include "krot/report/report_json.h"

namespace krot::internal {

// What the matches of a database say of a model's poses.

// "By the matches 39 of 249 pairs of images contradict the poses: 3 images are
// wrong."
std::string PairSentence(const PairCheck& check);

// Of a wrong image: "rotation: turned by 0.31 degrees".
std::string PoseFaultWords(const CheckedImage& image);

// For the terminal: the sentence, wrong images and pairs with wrong matches, at
// most max_rows of each.
std::string PairTable(const PairCheck& check, int max_rows);

// An object; docs/cli.md has its keys.
Json PairJson(const PairCheck& check);

}  // namespace krot::internal
