#pragma once

#include <string>

#include "krot/check.h"
#include "krot/report/report_json.h"

namespace krot::internal {

// What is wrong with a camera that images share, for example "its focal length
// is 1,106.2 px, and its 15 images ask for 1,019.5 px".
std::string CameraFaultWords(const WrongCamera& camera);

// What is wrong with cameras, and what to do; requires one at least.
std::string CamerasSentence(const ModelCheck& check);
std::string CameraTable(const ModelCheck& check, size_t max_rows);
nlohmann::ordered_json CamerasJson(const ModelCheck& check);

}  // namespace krot::internal
