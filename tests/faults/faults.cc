// A library to be preloaded (LD_PRELOAD) that makes a call of the system fail.
//
//   KROT_FAULT=KIND:N   the N-th call of this kind since main began
//   KROT_FAULT=KIND:N+  that one and all later ones, as on a disk that is full
//   KROT_FAULT_LOG=FILE takes "struck NAME" once a call has failed, and
//                       "KIND COUNT" when main returns, of the kind that was
//                       chosen and of all that change nothing by themselves
//
// What the kinds do is the table kKinds.

#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

namespace {

enum Call {
  kOpen = 1 << 0,
  kStat = 1 << 1,
  kRead = 1 << 2,
  kList = 1 << 3,
  kWrite = 1 << 4,
  kSync = 1 << 5,
  kClose = 1 << 6,
  kRename = 1 << 7,
  kExchange = 1 << 8,
  kLink = 1 << 9,
  kMkdir = 1 << 10,
  kRemove = 1 << 11,
  kChmod = 1 << 12,
  kMmap = 1 << 13,
  kMalloc = 1 << 14,
  kThread = 1 << 15,
  kAnyFile = kMmap - 1,
};

struct Kind {
  const char* name;
  int calls;        // that count
  int error;        // errno of the one that fails; 0: it does half, or dies
  int always_fail;  // calls that fail every time, as where there are none
};

constexpr Kind kKinds[] = {
    {"open", kOpen, EMFILE, 0},
    {"stat", kStat, EIO, 0},
    {"read", kRead, EIO, 0},
    {"read_short", kRead, 0, 0},  // half of the bytes
    {"read_interrupted", kRead, EINTR, 0},
    {"list", kList, EIO, 0},
    {"write", kWrite, ENOSPC, 0},
    {"write_short", kWrite, 0, 0},  // half of the bytes
    {"write_interrupted", kWrite, EINTR, 0},
    {"fsync", kSync, EIO, 0},
    {"close", kClose, EIO, 0},
    {"rename", kRename | kExchange, EIO, 0},
    {"rename_without_exchange", kRename, EIO, kExchange},
    {"link", kLink, EPERM, 0},
    {"write_without_link", kWrite, ENOSPC, kLink},
    {"mkdir", kMkdir, EDQUOT, 0},
    {"remove", kRemove, EIO, 0},
    {"chmod", kChmod, EPERM, 0},
    {"mmap", kMmap, ENOMEM, 0},
    {"malloc", kMalloc, ENOMEM, 0},
    {"thread", kThread, EAGAIN, 0},
    {"kill", kAnyFile, 0, 0},  // SIGKILL before the call
    {"kill_without_exchange", kAnyFile, 0, kExchange},
};

const Kind* chosen = nullptr;
long struck_call = 0;
bool is_sticky = false;
const char* log_file = nullptr;
std::atomic<long> num_calls{0};
std::atomic<long> num_of_call[16] = {};  // by the bit in Call
std::atomic<bool> is_armed{false};

template <typename Function>
Function Next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

// Past the functions below, which would count it.
void Log(const char* word, const char* value) {
  if (log_file == nullptr) return;
  const long file = syscall(SYS_openat, AT_FDCWD, log_file,
                            O_WRONLY | O_CREAT | O_APPEND, 0600);
  char line[80];
  const int length = snprintf(line, sizeof line, "%s %s\n", word, value);
  syscall(SYS_write, file, line, length);
  syscall(SYS_close, file);
}

// Whether this call must fail; errno is set then.
bool Strikes(int call, const char* name) {
  if (!is_armed.load(std::memory_order_relaxed)) return false;
  if ((chosen->always_fail & call) != 0) {
    errno = EINVAL;
    return true;
  }
  ++num_of_call[__builtin_ctz(static_cast<unsigned>(call))];
  if ((chosen->calls & call) == 0) return false;
  const long n = ++num_calls;
  if (n != struck_call && !(is_sticky && n > struck_call)) return false;
  if (n == struck_call) {
    Log("struck", name);
    if (chosen->calls == kAnyFile) syscall(SYS_kill, getpid(), 9);
  }
  errno = chosen->error;
  return true;
}

// Of a call that may do less than it was asked for: how many bytes it is asked
// for now; none, with errno, if it must fail.
size_t Allowed(int call, const char* name, size_t wanted) {
  if (!Strikes(call, name)) return wanted;
  return errno == 0 ? (wanted + 1) / 2 : 0;
}

// Tables and progress are no files.
bool IsFile(int descriptor) { return descriptor > STDERR_FILENO; }

using Main = int (*)(int, char**, char**);
Main real_main = nullptr;

int CountingMain(int argc, char** argv, char** environment) {
  unsetenv("LD_PRELOAD");
  is_armed = chosen != nullptr;
  const int exit_code = real_main(argc, argv, environment);
  is_armed = false;
  for (const Kind& kind : kKinds) {
    if (&kind != chosen && kind.always_fail != 0) continue;
    long sum = 0;
    for (int bit = 0; bit < 16; ++bit) {
      if ((kind.calls >> bit & 1) != 0) sum += num_of_call[bit];
    }
    char count[24];
    snprintf(count, sizeof count, "%ld", sum);
    Log(kind.name, count);
  }
  return exit_code;
}

void ReadEnvironment() {
  log_file = getenv("KROT_FAULT_LOG");
  const char* fault = getenv("KROT_FAULT");
  const char* colon = fault == nullptr ? nullptr : strchr(fault, ':');
  if (colon == nullptr) return;
  char* rest = nullptr;
  struck_call = strtol(colon + 1, &rest, 10);
  is_sticky = *rest == '+';
  for (const Kind& kind : kKinds) {
    const size_t length = strlen(kind.name);
    if (length == static_cast<size_t>(colon - fault) &&
        strncmp(kind.name, fault, length) == 0) {
      chosen = &kind;
    }
  }
}

}  // namespace

extern "C" {

int __libc_start_main(Main main, int argc, char** argv, void (*init)(),
                      void (*fini)(), void (*rtld_fini)(), void* stack_end) {
  ReadEnvironment();
  real_main = main;
  return Next<decltype(&__libc_start_main)>("__libc_start_main")(
      &CountingMain, argc, argv, init, fini, rtld_fini, stack_end);
}

// `result name(parameters)`, which returns `failure` when struck.
#define KROT_FAULT_FUNCTION(call, result, failure, name, parameters, \
                            arguments)                               \
  result name parameters {                                           \
    static const auto next = Next<result(*) parameters>(#name);      \
    if (Strikes(call, #name)) return failure;                        \
    return next arguments;                                           \
  }

#define KROT_FAULT_OPEN(name)                                             \
  int name(const char* path, int flags, ...) {                            \
    static const auto next = Next<int (*)(const char*, int, ...)>(#name); \
    va_list rest;                                                         \
    va_start(rest, flags);                                                \
    const mode_t mode = (flags & O_CREAT) ? va_arg(rest, mode_t) : 0;     \
    va_end(rest);                                                         \
    return Strikes(kOpen, #name) ? -1 : next(path, flags, mode);          \
  }
KROT_FAULT_OPEN(open)
KROT_FAULT_OPEN(open64)
// What removes a folder goes down by these.
int openat(int folder, const char* path, int flags, ...) {
  static const auto next = Next<int (*)(int, const char*, int, ...)>("openat");
  return Strikes(kOpen, "openat") ? -1 : next(folder, path, flags);
}
KROT_FAULT_FUNCTION(kOpen, FILE*, nullptr, fopen,
                    (const char* path, const char* mode), (path, mode))
KROT_FAULT_FUNCTION(kOpen, FILE*, nullptr, fopen64,
                    (const char* path, const char* mode), (path, mode))
KROT_FAULT_FUNCTION(kOpen, DIR*, nullptr, opendir, (const char* path), (path))
KROT_FAULT_FUNCTION(kOpen, DIR*, nullptr, fdopendir, (int file), (file))

KROT_FAULT_FUNCTION(kStat, int, -1, stat,
                    (const char* path, struct stat* status), (path, status))
KROT_FAULT_FUNCTION(kStat, int, -1, lstat,
                    (const char* path, struct stat* status), (path, status))
KROT_FAULT_FUNCTION(kStat, int, -1, fstat, (int file, struct stat* status),
                    (file, status))
KROT_FAULT_FUNCTION(kStat, int, -1, statx,
                    (int folder, const char* path, int flags, unsigned mask,
                     struct statx* status),
                    (folder, path, flags, mask, status))
KROT_FAULT_FUNCTION(kStat, int, -1, access, (const char* path, int mode),
                    (path, mode))
KROT_FAULT_FUNCTION(kStat, char*, nullptr, realpath,
                    (const char* path, char* resolved), (path, resolved))
KROT_FAULT_FUNCTION(kStat, char*, nullptr, getcwd, (char* path, size_t size),
                    (path, size))

ssize_t read(int file, void* bytes, size_t count) {
  static const auto next = Next<ssize_t (*)(int, void*, size_t)>("read");
  const size_t allowed = Allowed(kRead, "read", count);
  return allowed == 0 && count > 0 ? -1 : next(file, bytes, allowed);
}

ssize_t pread(int file, void* bytes, size_t count, off_t offset) {
  static const auto next =
      Next<ssize_t (*)(int, void*, size_t, off_t)>("pread");
  const size_t allowed = Allowed(kRead, "pread", count);
  return allowed == 0 && count > 0 ? -1 : next(file, bytes, allowed, offset);
}

KROT_FAULT_FUNCTION(kList, struct dirent*, nullptr, readdir, (DIR * folder),
                    (folder))

ssize_t write(int file, const void* bytes, size_t count) {
  static const auto next = Next<ssize_t (*)(int, const void*, size_t)>("write");
  const size_t allowed = IsFile(file) ? Allowed(kWrite, "write", count) : count;
  return allowed == 0 && count > 0 ? -1 : next(file, bytes, allowed);
}

ssize_t pwrite(int file, const void* bytes, size_t count, off_t offset) {
  static const auto next =
      Next<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite");
  const size_t allowed = Allowed(kWrite, "pwrite", count);
  return allowed == 0 && count > 0 ? -1 : next(file, bytes, allowed, offset);
}

ssize_t sendfile(int out, int in, off_t* offset, size_t count) {
  static const auto next =
      Next<ssize_t (*)(int, int, off_t*, size_t)>("sendfile");
  const size_t allowed = Allowed(kWrite, "sendfile", count);
  return allowed == 0 && count > 0 ? -1 : next(out, in, offset, allowed);
}

KROT_FAULT_FUNCTION(kSync, int, -1, fsync, (int file), (file))

// The descriptor is gone all the same, as with the system's own failures.
int close(int file) {
  static const auto next = Next<int (*)(int)>("close");
  const bool strikes = Strikes(kClose, "close");
  const int error = errno;
  const int result = next(file);
  if (!strikes) return result;
  errno = error;
  return -1;
}

KROT_FAULT_FUNCTION(kRename, int, -1, rename,
                    (const char* from, const char* to), (from, to))
KROT_FAULT_FUNCTION(kExchange, int, -1, renameat2,
                    (int a, const char* from, int b, const char* to,
                     unsigned flags),
                    (a, from, b, to, flags))
KROT_FAULT_FUNCTION(kLink, int, -1, link, (const char* from, const char* to),
                    (from, to))
KROT_FAULT_FUNCTION(kMkdir, int, -1, mkdir, (const char* path, mode_t mode),
                    (path, mode))
KROT_FAULT_FUNCTION(kRemove, int, -1, remove, (const char* path), (path))
KROT_FAULT_FUNCTION(kRemove, int, -1, unlinkat,
                    (int folder, const char* path, int flags),
                    (folder, path, flags))
KROT_FAULT_FUNCTION(kChmod, int, -1, chmod, (const char* path, mode_t mode),
                    (path, mode))
KROT_FAULT_FUNCTION(kChmod, int, -1, fchmod, (int file, mode_t mode),
                    (file, mode))
KROT_FAULT_FUNCTION(kChmod, int, -1, fchmodat,
                    (int folder, const char* path, mode_t mode, int flags),
                    (folder, path, mode, flags))
KROT_FAULT_FUNCTION(kMmap, void*, MAP_FAILED, mmap,
                    (void* address, size_t size, int protection, int flags,
                     int file, off_t offset),
                    (address, size, protection, flags, file, offset))

int pthread_create(pthread_t* thread, const pthread_attr_t* attributes,
                   void* (*run)(void*), void* argument) {
  static const auto next = Next<decltype(&pthread_create)>("pthread_create");
  if (Strikes(kThread, "pthread_create")) return errno;
  return next(thread, attributes, run, argument);
}

// dlsym allocates: these go straight to the C library's own.
void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* old, size_t size);
void* __libc_memalign(size_t alignment, size_t size);

void* malloc(size_t size) {
  return Strikes(kMalloc, "malloc") ? nullptr : __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
  return Strikes(kMalloc, "calloc") ? nullptr : __libc_calloc(count, size);
}
void* realloc(void* old, size_t size) {
  return Strikes(kMalloc, "realloc") ? nullptr : __libc_realloc(old, size);
}
void* aligned_alloc(size_t alignment, size_t size) {
  return Strikes(kMalloc, "aligned_alloc") ? nullptr
                                           : __libc_memalign(alignment, size);
}
int posix_memalign(void** result, size_t alignment, size_t size) {
  if (Strikes(kMalloc, "posix_memalign")) return ENOMEM;
  *result = __libc_memalign(alignment, size);
  return *result == nullptr ? ENOMEM : 0;
}

}  // extern "C"
