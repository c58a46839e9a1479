#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace krot::internal {

// The names that text files give to the sensor types -1, 0 and 1: INVALID,
// CAMERA, IMU. None for other types and names.
std::optional<std::string_view> SensorTypeName(int32_t type);
std::optional<int32_t> SensorTypeFromName(std::string_view name);

}  // namespace krot::internal
