#pragma once

#include <cstdlib>
#include <string_view>

namespace krot::internal {

// The vector units that kernels are compiled for, in a build for any machine:
// krot_native_kernel of cmake/KrotTargets.cmake. In a namespace each,
// KROT_UNITS.
enum class VectorUnits {
  kOwn,  // those that the whole program is compiled for
#ifdef KROT_CHOOSES_UNITS
  kAvx2,
  kAvx512,
#endif
};

// The best ones that this processor has. The environment variable KROT_KERNELS
// names lesser ones, "own" or "avx2", for results that have the same bits on
// another machine. Reads the environment at its first call.
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

// What is the same in all namespaces but for its units; of those of TABLE, the
// best one.
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
