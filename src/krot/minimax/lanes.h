#pragma once

#include <cmath>

#include "krot/minimax/kernels.h"

namespace krot::internal::KROT_UNITS {

// Arithmetic in all lanes at once, for kernels only (krot_native_kernel). The
// lanes are stored in vectors of the length for which the file is compiled. It
// uses the vector types of GCC and Clang, as compilers do not reliably
// vectorise loops over so few lanes. Except for Any, no operation mixes lanes:
// the result in a lane depends on that lane only.

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

// Per lane: true if all bits are set, false if none is.
struct LaneMask {
  typedef long long Vector __attribute__((vector_size(kVectorBytes)));
  Vector v[kVectors];
};

// Defines an operator that acts on each vector of its operands.
#define KROT_LANE_OPERATOR(Result, op, Operand)                   \
  inline Result operator op(const Operand& a, const Operand& b) { \
    Result c;                                                     \
    for (int i = 0; i < kVectors; ++i) c.v[i] = a.v[i] op b.v[i]; \
    return c;                                                     \
  }
KROT_LANE_OPERATOR(Lanes, +, Lanes)
KROT_LANE_OPERATOR(Lanes, -, Lanes)
KROT_LANE_OPERATOR(Lanes, *, Lanes)
KROT_LANE_OPERATOR(Lanes, /, Lanes)
KROT_LANE_OPERATOR(LaneMask, <, Lanes)
KROT_LANE_OPERATOR(LaneMask, <=, Lanes)
KROT_LANE_OPERATOR(LaneMask, ==, Lanes)
KROT_LANE_OPERATOR(LaneMask, &, LaneMask)
KROT_LANE_OPERATOR(LaneMask, |, LaneMask)
#undef KROT_LANE_OPERATOR

inline Lanes operator-(const Lanes& a) {
  Lanes c;
  for (int i = 0; i < kVectors; ++i) c.v[i] = -a.v[i];
  return c;
}
inline Lanes& operator+=(Lanes& a, const Lanes& b) { return a = a + b; }
inline LaneMask operator>(const Lanes& a, const Lanes& b) { return b < a; }
inline LaneMask operator>=(const Lanes& a, const Lanes& b) { return b <= a; }
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

// A 3 x 3 matrix in every lane, symmetric or lower triangular.
struct LaneMatrix {
  Lanes m00, m10, m20, m11, m21, m22;
};

inline LaneMatrix operator+(const LaneMatrix& a, const LaneMatrix& b) {
  return {a.m00 + b.m00, a.m10 + b.m10, a.m20 + b.m20,
          a.m11 + b.m11, a.m21 + b.m21, a.m22 + b.m22};
}
inline LaneMatrix operator*(const Lanes& s, const LaneMatrix& a) {
  return {s * a.m00, s * a.m10, s * a.m20, s * a.m11, s * a.m21, s * a.m22};
}
inline LaneMatrix Select(const LaneMask& mask, const LaneMatrix& yes,
                         const LaneMatrix& no) {
  return {Select(mask, yes.m00, no.m00), Select(mask, yes.m10, no.m10),
          Select(mask, yes.m20, no.m20), Select(mask, yes.m11, no.m11),
          Select(mask, yes.m21, no.m21), Select(mask, yes.m22, no.m22)};
}

// a a'.
inline LaneMatrix Square(const Lanes3& a) {
  return {a.x * a.x, a.y * a.x, a.z * a.x, a.y * a.y, a.z * a.y, a.z * a.z};
}

// d'Md, M symmetric.
inline Lanes QuadraticForm(const LaneMatrix& M, const Lanes3& d) {
  return d.x * (M.m00 * d.x + 2 * (M.m10 * d.y + M.m20 * d.z)) +
         d.y * (M.m11 * d.y + 2 * M.m21 * d.z) + d.z * M.m22 * d.z;
}

// Lg and L'g, L lower triangular.
inline Lanes3 Times(const LaneMatrix& L, const Lanes3& g) {
  return {L.m00 * g.x, L.m10 * g.x + L.m11 * g.y,
          L.m20 * g.x + L.m21 * g.y + L.m22 * g.z};
}
inline Lanes3 TransposedTimes(const LaneMatrix& L, const Lanes3& g) {
  return {L.m00 * g.x + L.m10 * g.y + L.m20 * g.z, L.m11 * g.y + L.m21 * g.z,
          L.m22 * g.z};
}

// The inverse of the Cholesky factor L of H = L L'. Pivots below `rounding`
// times the trace are raised to that.
inline LaneMatrix InverseCholesky(const LaneMatrix& H, double rounding) {
  const Lanes floor = rounding * (H.m00 + H.m11 + H.m22);
  const Lanes i00 = 1 / Sqrt(H.m00);
  const Lanes l10 = H.m10 * i00;
  const Lanes l20 = H.m20 * i00;
  const Lanes i11 = 1 / Sqrt(Max(H.m11 - l10 * l10, floor));
  const Lanes l21 = (H.m21 - l20 * l10) * i11;
  const Lanes i22 = 1 / Sqrt(Max(H.m22 - l20 * l20 - l21 * l21, floor));
  const Lanes i10 = -l10 * i00 * i11;
  return {i00, i10, -(l20 * i00 + l21 * i10) * i22, i11, -l21 * i11 * i22, i22};
}

inline LaneMatrix Load(const LaneDoubles (&memory)[6]) {
  return {Load(memory[0]), Load(memory[1]), Load(memory[2]),
          Load(memory[3]), Load(memory[4]), Load(memory[5])};
}
inline void Store(const LaneMatrix& lanes, LaneDoubles (*memory)[6]) {
  Store(lanes.m00, &(*memory)[0]);
  Store(lanes.m10, &(*memory)[1]);
  Store(lanes.m20, &(*memory)[2]);
  Store(lanes.m11, &(*memory)[3]);
  Store(lanes.m21, &(*memory)[4]);
  Store(lanes.m22, &(*memory)[5]);
}

}  // namespace krot::internal::KROT_UNITS
