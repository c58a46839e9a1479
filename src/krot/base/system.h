#pragma once

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace krot::internal {

// Everything that operating systems do differently; implemented in
// system_posix.cc and system_windows.cc. Texts are UTF-8 on both. And what
// processors do differently.

// An open file. It is closed when it goes out of scope, and child processes do
// not inherit it. Functions that fail leave the reason in errno.
class FileDescriptor {
 public:
  enum class Use {
    kRead,
    kReplace,  // write; the file's old content is lost
    kUpdate,   // read and write
  };
  // kReplace and kUpdate create the file if it does not exist.
  FileDescriptor(const std::filesystem::path& file, Use use);
  ~FileDescriptor() {
    if (is_open()) Close();
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;

  bool is_open() const { return value_ >= 0; }
  // Size in bytes; none if it is a folder, a pipe or a device, or on failure.
  std::optional<int64_t> RegularSize() const;
  // Reads `size` bytes from `offset` on, or as many as there are.
  bool ReadAt(int64_t offset, size_t size, std::string* bytes) const;
  // Writes all bytes, from where Truncate or the last Write ended.
  bool Write(std::string_view bytes) const;
  // Cuts the file to `size` bytes; later writes continue there.
  bool Truncate(int64_t size) const;
  // Forces what was written to the disk.
  bool Sync() const;
  // Locks the file against other processes' Lock; false if one of them has it.
  bool Lock() const;
  // Closes the file; false if earlier writes did not reach it.
  bool Close();

 private:
  int value_;
};

// ---- Folders ----

// Why nothing can be created in `folder`; no error if something can. This is
// tried, because root's permissions say nothing about /proc or a read-only
// disk; nothing remains.
std::error_code TryToCreateIn(const std::filesystem::path& folder);
// Forces the names in a folder to the disk, if that is left to programs and the
// folder may be read.
std::error_code SyncEntries(const std::filesystem::path& folder);
// Why the entries of `folder` may not be listed or changed, as far as its
// permissions say.
std::error_code CheckPermissions(const std::filesystem::path& folder);
// Always false if the system does not say.
bool IsMountPoint(const std::filesystem::path& folder);
// Exchanges two names in one step; errc::function_not_supported if the system
// or the file system cannot.
std::error_code ExchangeNames(const std::filesystem::path& a,
                              const std::filesystem::path& b);

// ---- The process ----

// The arguments after the program's name. Must be the first call, and be called
// once: on Windows it also sets the console to UTF-8, and stdout and stderr not
// to change line ends.
std::vector<std::string> ProgramArguments(int argc, char** argv);
int ProcessId();
// Calls `handler` on Ctrl-C or when the process is asked to end (SIGINT,
// SIGTERM): in a signal handler, or on Windows on a thread of its own, so it
// may do only what signal handlers may. With `once`, the next request ends the
// process.
void OnEndRequest(void (*handler)(), bool once);
// Calls `function` in every child process after a fork.
void OnFork(void (*function)());
// Where the address space of the process is limited, ends it, without functions
// that run at exit: there OpenBLAS, if it is installed, waits for its threads,
// which wait for memory without end. Elsewhere returns the exit code. Streams
// must be flushed.
int EndIfMemoryIsLimited(int exit_code);
// Writes the text to stderr unchanged; may be called in a signal handler. False
// if it fails.
bool WriteToStderr(std::string_view text);

// Memory that this process can still take, bytes: the smallest of the free
// memory and swap of the machine, the limit of the control group (its cache may
// be dropped, so what it uses does not count), and the rest of the address
// space. Where the system does not say, there is no limit.
int64_t FreeMemoryBytes();
int64_t ResidentBytes();  // at present
int64_t PeakMemoryBytes();

// ---- The terminal ----

bool IsStderrTerminal();
// Whether it is one on which a return begins its line anew.
bool CanRewriteLines();
std::optional<int> TerminalColumns();

// ---- The machine; "unknown" and 0 if the system does not say ----

std::string CpuName();
std::string SystemName();
double LoadAverage();  // runnable processes, mean of the last minute

// ---- Vector units ----

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
