#pragma once

#include <cmath>

#include "krot/minimax/lane_memory.h"

namespace krot::internal {

// Arithmetic in all lanes at once, for kernels alone (krot_native_kernel): the
// vectors are as long as those of the machine that the file is compiled for,
// and there are as many as the lanes fill. GCC's and Clang's vector types say
// so; loops over lanes of this size are not reliably made vector code. No
// operation but Any looks from one lane into another: what comes out of a lane
// depends on that lane alone.

#if defined(__AVX512F__)
inline constexpr int kVectorBytes = 64;
#elif defined(__AVX__)
inline constexpr int kVectorBytes = 32;
#else
inline constexpr int kVectorBytes = 16;
#endif
inline constexpr int kVectorLanes = kVectorBytes / sizeof(double);
inline constexpr int kVectors = kLanes / kVectorLanes;

struct Lanes {
  // May alias the numbers in memory that it holds.
  typedef double Vector __attribute__((vector_size(kVectorBytes), may_alias));
  Vector v[kVectors];

  Lanes() = default;
  Lanes(double value) {  // NOLINT: numbers stand for themselves in all lanes
    for (Vector& part : v) part = value - Vector{};
  }
};

// True where all bits are set, false where none is.
struct LaneMask {
  typedef long long Vector __attribute__((vector_size(kVectorBytes)));
  Vector v[kVectors];
};

inline Lanes operator+(const Lanes& a, const Lanes& b) {
  Lanes c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = a.v[i] + b.v[i];
  return c;
}
inline Lanes operator-(const Lanes& a, const Lanes& b) {
  Lanes c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = a.v[i] - b.v[i];
  return c;
}
inline Lanes operator*(const Lanes& a, const Lanes& b) {
  Lanes c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = a.v[i] * b.v[i];
  return c;
}
inline Lanes operator/(const Lanes& a, const Lanes& b) {
  Lanes c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = a.v[i] / b.v[i];
  return c;
}
inline Lanes operator-(const Lanes& a) {
  Lanes c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = -a.v[i];
  return c;
}
inline Lanes& operator+=(Lanes& a, const Lanes& b) { return a = a + b; }

inline LaneMask operator<(const Lanes& a, const Lanes& b) {
  LaneMask c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = a.v[i] < b.v[i];
  return c;
}
inline LaneMask operator<=(const Lanes& a, const Lanes& b) {
  LaneMask c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = a.v[i] <= b.v[i];
  return c;
}
inline LaneMask operator==(const Lanes& a, const Lanes& b) {
  LaneMask c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = a.v[i] == b.v[i];
  return c;
}
inline LaneMask operator>(const Lanes& a, const Lanes& b) { return b < a; }
inline LaneMask operator>=(const Lanes& a, const Lanes& b) { return b <= a; }

inline LaneMask operator&(const LaneMask& a, const LaneMask& b) {
  LaneMask c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = a.v[i] & b.v[i];
  return c;
}
inline LaneMask operator|(const LaneMask& a, const LaneMask& b) {
  LaneMask c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = a.v[i] | b.v[i];
  return c;
}
inline LaneMask operator~(const LaneMask& a) {
  LaneMask c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = ~a.v[i];
  return c;
}

inline Lanes Select(const LaneMask& mask, const Lanes& yes, const Lanes& no) {
  Lanes c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = mask.v[i] ? yes.v[i] : no.v[i];
  return c;
}
inline Lanes Max(const Lanes& a, const Lanes& b) { return Select(a < b, b, a); }
inline Lanes Min(const Lanes& a, const Lanes& b) { return Select(b < a, b, a); }
inline Lanes Sqrt(const Lanes& a) {
  Lanes c;
  for (int i = 0; i < kVectors; ++i) {
    for (int k = 0; k < kVectorLanes; ++k) c.v[i][k] = std::sqrt(a.v[i][k]);
  }
  return c;
}
inline bool Any(const LaneMask& mask) {
  LaneMask::Vector any = mask.v[0];
  for (int i = 1; i < kVectors; ++i) any |= mask.v[i];
  long long result = 0;
  for (int k = 0; k < kVectorLanes; ++k) result |= any[k];
  return result != 0;
}

inline Lanes Load(const LaneDoubles& memory) {
  Lanes lanes;
  for (int i = 0; i < kVectors; ++i) {
    lanes.v[i] =
        *reinterpret_cast<const Lanes::Vector*>(memory + i * kVectorLanes);
  }
  return lanes;
}
inline void Store(const Lanes& lanes, LaneDoubles* memory) {
  for (int i = 0; i < kVectors; ++i) {
    *reinterpret_cast<Lanes::Vector*>(*memory + i * kVectorLanes) = lanes.v[i];
  }
}

struct Lanes3 {
  Lanes x, y, z;
};

inline Lanes3 operator+(const Lanes3& a, const Lanes3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Lanes3 operator-(const Lanes3& a, const Lanes3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Lanes3 operator*(const Lanes& s, const Lanes3& a) {
  return {s * a.x, s * a.y, s * a.z};
}
inline Lanes Dot(const Lanes3& a, const Lanes3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Lanes3 Select(const LaneMask& mask, const Lanes3& yes,
                     const Lanes3& no) {
  return {Select(mask, yes.x, no.x), Select(mask, yes.y, no.y),
          Select(mask, yes.z, no.z)};
}
inline Lanes3 Load(const LaneDoubles (&memory)[3]) {
  return {Load(memory[0]), Load(memory[1]), Load(memory[2])};
}
inline void Store(const Lanes3& lanes, LaneDoubles (*memory)[3]) {
  Store(lanes.x, &(*memory)[0]);
  Store(lanes.y, &(*memory)[1]);
  Store(lanes.z, &(*memory)[2]);
}

}  // namespace krot::internal
