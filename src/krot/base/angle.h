#pragma once

namespace krot {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kHalfPi = kPi / 2;
inline constexpr double kDegreesPerRadian = 180 / kPi;

}  // namespace krot
