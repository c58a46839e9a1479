#include "krot/model/sensor_type.h"

#include "krot/model.h"

namespace krot::internal {
namespace {

struct Entry {
  int32_t type;
  std::string_view name;
};
constexpr Entry kEntries[] = {{kSensorTypeInvalid, "INVALID"},
                              {kSensorTypeCamera, "CAMERA"},
                              {kSensorTypeImu, "IMU"}};

}  // namespace

std::optional<std::string_view> SensorTypeName(int32_t type) {
  for (const Entry& entry : kEntries) {
    if (entry.type == type) return entry.name;
  }
  return std::nullopt;
}

std::optional<int32_t> SensorTypeFromName(std::string_view name) {
  for (const Entry& entry : kEntries) {
    if (entry.name == name) return entry.type;
  }
  return std::nullopt;
}

}  // namespace krot::internal
