#pragma once

#include <cstdlib>
#include <string_view>

namespace krot::internal {

// The vector units that kernels are compiled for in a build for any machine
// (krot_native_kernel of cmake/KrotTargets.cmake). The kernels for each are in
// a namespace of their own, KROT_UNITS.
enum class VectorUnits {
  kOwn,  // those that the whole program is compiled for
#ifdef KROT_CHOOSES_UNITS
  kAvx2,
  kAvx512,
#endif
};

// The best units that this processor has. The environment variable KROT_KERNELS
// can limit them to "own" or "avx2", to get the same bits on different
// machines. It is read at the first call.
inline VectorUnits BestVectorUnits() {
#ifdef KROT_CHOOSES_UNITS
  static const VectorUnits best = [] {
    const char* asked = std::getenv("KROT_KERNELS");
    const std::string_view limit = asked == nullptr ? "" : asked;
    if (limit == "own" || !__builtin_cpu_supports("avx2") ||
        !__builtin_cpu_supports("fma")) {
      return VectorUnits::kOwn;
    }
    const bool has_512 = __builtin_cpu_supports("avx512f") &&
                         __builtin_cpu_supports("avx512dq") &&
                         __builtin_cpu_supports("avx512vl");
    return has_512 && limit != "avx2" ? VectorUnits::kAvx512
                                      : VectorUnits::kAvx2;
  }();
  return best;
#else
  return VectorUnits::kOwn;
#endif
}

// KROT_DECLARE_KERNELS declares a table of kernels in the namespace of each
// unit; KROT_BEST_KERNELS chooses that of the best units.
#ifdef KROT_CHOOSES_UNITS
#define KROT_DECLARE_KERNELS(Type, table) \
  namespace own {                         \
  extern const Type table;                \
  }                                       \
  namespace avx2 {                        \
  extern const Type table;                \
  }                                       \
  namespace avx512 {                      \
  extern const Type table;                \
  }
#define KROT_BEST_KERNELS(table)                             \
  (BestVectorUnits() == VectorUnits::kAvx512 ? avx512::table \
   : BestVectorUnits() == VectorUnits::kAvx2 ? avx2::table   \
                                             : own::table)
#else
#define KROT_DECLARE_KERNELS(Type, table) \
  namespace own {                         \
  extern const Type table;                \
  }
#define KROT_BEST_KERNELS(table) own::table
#endif

}  // namespace krot::internal
