// Replaces the global operator new of a program, so that large arrays lie in
// huge pages where the system gives them on request (where
// /sys/kernel/mm/transparent_hugepage/enabled says "madvise", as on Debian).
// Solves of millions of observations fill and free arrays of gigabytes; with
// pages of 4 kB the system takes a quarter of the time. Not in a library, whose
// users choose their own operator new.
//
// Operator delete stays as it is, as all of this memory is freed by std::free.

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <new>

// Sanitizers bring their own operator new. GCC and Clang show in different ways
// that one is used.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define KROT_IS_SANITIZED
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define KROT_IS_SANITIZED
#endif
#endif

#if defined(__linux__) && !defined(KROT_IS_SANITIZED)
#include <sys/mman.h>

namespace {

constexpr std::size_t kHugePage = std::size_t{2} << 20;

// Ordinary memory; null if there is none.
void* TryAllocateAsEver(std::size_t size, std::size_t alignment) {
  return alignment <= alignof(std::max_align_t)
             ? std::malloc(std::max<std::size_t>(size, 1))
             : std::aligned_alloc(alignment,
                                  (size + alignment - 1) & ~(alignment - 1));
}

void* TryAllocate(std::size_t size, std::size_t alignment) {
  void* memory = nullptr;
  // Alignment takes up to one more huge page, but of address space alone.
  if (size < kHugePage ||
      posix_memalign(&memory, std::max(alignment, kHugePage), size) != 0) {
    return TryAllocateAsEver(size, alignment);
  }
  // Only advice: if the system does not take it, pages are small.
  madvise(memory, size & ~(kHugePage - 1), MADV_HUGEPAGE);
  return memory;
}

void* Allocate(std::size_t size, std::size_t alignment) {
  for (;;) {
    if (void* memory = TryAllocate(size, alignment)) return memory;
    const std::new_handler handler = std::get_new_handler();
    if (handler == nullptr) throw std::bad_alloc();
    handler();
  }
}

}  // namespace

void* operator new(std::size_t size) {
  return Allocate(size, alignof(std::max_align_t));
}

void* operator new(std::size_t size, std::align_val_t alignment) {
  return Allocate(size, static_cast<std::size_t>(alignment));
}

#endif
