// Replaces the global operator new of a program: what is large lies in huge
// pages, where the system gives them to those who ask (in
// /sys/kernel/mm/transparent_hugepage/enabled, "madvise", as Debian has it).
// Solves of millions of observations fill and free arrays of gigabytes: page by
// page of 4 kB, the system's part of that is a quarter of the time. Not in a
// library, whose users choose their own.
//
// Operator delete may stay as it is: all of this is freed by std::free.

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <new>

// A sanitizer has its own: GCC says so in one way, Clang in another.
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
// To be aligned an array takes up to one more of address space: little beside
// these.
constexpr std::size_t kLarge = 8 * kHugePage;

// Null where there is no such memory.
void* TryAllocateAsEver(std::size_t size, std::size_t alignment) {
  return alignment <= alignof(std::max_align_t)
             ? std::malloc(std::max<std::size_t>(size, 1))
             : std::aligned_alloc(alignment,
                                  (size + alignment - 1) & ~(alignment - 1));
}

void* TryAllocate(std::size_t size, std::size_t alignment) {
  void* memory = nullptr;
  if (size < kLarge ||
      posix_memalign(&memory, std::max(alignment, kHugePage), size) != 0) {
    return TryAllocateAsEver(size, alignment);
  }
  // Advice: where it is not taken, pages are small.
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
