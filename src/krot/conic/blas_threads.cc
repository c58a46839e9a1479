#include "krot/conic/blas_threads.h"

#include <cstdint>

// Weak: null unless the BLAS that is linked has them.
extern "C" {
[[gnu::weak]] int openblas_get_num_threads(void);
[[gnu::weak]] void openblas_set_num_threads(int num_threads);
[[gnu::weak]] int MKL_Get_Max_Threads(void);
[[gnu::weak]] void MKL_Set_Num_Threads(int num_threads);
[[gnu::weak]] int64_t bli_thread_get_num_threads(void);
[[gnu::weak]] void bli_thread_set_num_threads(int64_t num_threads);
}

namespace krot {
namespace {

template <typename Count>
void UseOne(Count (*get)(), void (*set)(Count)) {
  if (get != nullptr && set != nullptr && get() != 1) set(1);
}

}  // namespace

void UseOneBlasThread() {
  UseOne(&openblas_get_num_threads, &openblas_set_num_threads);
  UseOne(&MKL_Get_Max_Threads, &MKL_Set_Num_Threads);
  UseOne(&bli_thread_get_num_threads, &bli_thread_set_num_threads);
}

}  // namespace krot
