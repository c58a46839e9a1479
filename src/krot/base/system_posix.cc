#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <limits>

#include "krot/base/system.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

std::error_code LastError() { return {errno, std::generic_category()}; }

int Open(const fs::path& file, FileDescriptor::Use use) {
  int flags = O_RDONLY;
  if (use == FileDescriptor::Use::kReplace) {
    flags = O_WRONLY | O_CREAT | O_TRUNC;
  } else if (use == FileDescriptor::Use::kUpdate) {
    flags = O_RDWR | O_CREAT;
  }
  return ::open(file.c_str(), flags | O_CLOEXEC, mode_t{0666});
}

// A file system without fsync answers EINVAL; that is no failure.
bool SyncDescriptor(int descriptor) {
  return ::fsync(descriptor) == 0 || errno == EINVAL;
}

bool WriteAll(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t result = ::write(descriptor, bytes.data(), bytes.size());
    if (result < 0 && errno == EINTR) continue;
    if (result < 0) return false;
    bytes.remove_prefix(static_cast<size_t>(result));
  }
  return true;
}

}  // namespace

FileDescriptor::FileDescriptor(const fs::path& file, Use use)
    : value_(Open(file, use)) {}

std::optional<int64_t> FileDescriptor::RegularSize() const {
  struct stat status = {};
  if (::fstat(value_, &status) != 0) return std::nullopt;
  if (!S_ISREG(status.st_mode)) {
    errno = EINVAL;
    return std::nullopt;
  }
  return status.st_size;
}

bool FileDescriptor::ReadAt(int64_t offset, size_t size,
                            std::string* bytes) const {
  bytes->resize(size);
  size_t done = 0;
  while (done < size) {
    const ssize_t result = ::pread(value_, bytes->data() + done, size - done,
                                   offset + static_cast<int64_t>(done));
    if (result < 0 && errno == EINTR) continue;
    if (result < 0) return false;
    if (result == 0) break;
    done += static_cast<size_t>(result);
  }
  bytes->resize(done);
  return true;
}

bool FileDescriptor::Write(std::string_view bytes) const {
  return WriteAll(value_, bytes);
}

bool FileDescriptor::Truncate(int64_t size) const {
  return ::ftruncate(value_, size) == 0 && ::lseek(value_, size, SEEK_SET) >= 0;
}

bool FileDescriptor::Sync() const { return SyncDescriptor(value_); }

bool FileDescriptor::Lock() const {
  return ::flock(value_, LOCK_EX | LOCK_NB) == 0;
}

bool FileDescriptor::Close() {
  const int value = value_;
  value_ = -1;
  return ::close(value) == 0;
}

std::error_code TryToCreateIn(const fs::path& folder) {
#ifdef O_TMPFILE
  // First try a file without a name; not all file systems have these.
  const int unnamed =
      ::open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, mode_t{0600});
  if (unnamed >= 0) {
    ::close(unnamed);
    return {};
  }
#endif
  const fs::path named = folder / (".krot-" + std::to_string(::getpid()));
  const bool is_there =
      ::mkdir(named.c_str(), mode_t{0700}) == 0 || errno == EEXIST;
  if (is_there && ::rmdir(named.c_str()) == 0) return {};
  return LastError();
}

std::error_code SyncEntries(const fs::path& folder) {
  const int descriptor =
      ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return {};
  const std::error_code error =
      SyncDescriptor(descriptor) ? std::error_code() : LastError();
  ::close(descriptor);
  return error;
}

std::error_code CheckPermissions(const fs::path& folder) {
  return ::access(folder.c_str(), R_OK | W_OK | X_OK) == 0 ? std::error_code()
                                                           : LastError();
}

bool IsMountPoint([[maybe_unused]] const fs::path& folder) {
#ifdef STATX_ATTR_MOUNT_ROOT
  struct statx status;
  return ::statx(AT_FDCWD, folder.c_str(), 0, 0, &status) == 0 &&
         (status.stx_attributes & STATX_ATTR_MOUNT_ROOT) != 0;
#else
  return false;
#endif
}

std::error_code ExchangeNames([[maybe_unused]] const fs::path& a,
                              [[maybe_unused]] const fs::path& b) {
#ifdef RENAME_EXCHANGE
  if (::renameat2(AT_FDCWD, a.c_str(), AT_FDCWD, b.c_str(), RENAME_EXCHANGE) ==
      0) {
    return {};
  }
  if (errno != EINVAL && errno != ENOSYS) return LastError();
#endif
  return std::make_error_code(std::errc::function_not_supported);
}

std::vector<std::string> ProgramArguments(int argc, char** argv) {
  return {argv + std::min(argc, 1), argv + argc};
}

int ProcessId() { return ::getpid(); }

namespace {

void (*on_end_request)() = nullptr;

void HandleSignal(int) { on_end_request(); }

}  // namespace

void OnEndRequest(void (*handler)(), bool once) {
  on_end_request = handler;
  struct sigaction action = {};
  action.sa_handler = &HandleSignal;
  action.sa_flags = once ? static_cast<int>(SA_RESETHAND) | SA_RESTART : 0;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

void OnFork(void (*function)()) { pthread_atfork(nullptr, nullptr, function); }

bool WriteToStderr(std::string_view text) {
  return WriteAll(STDERR_FILENO, text);
}

namespace {

constexpr int64_t kUnlimited = std::numeric_limits<int64_t>::max();

// The sum of "MemAvailable:  12345 kB" and "SwapFree:" in /proc/meminfo, in
// bytes.
int64_t FreeOfMachine() {
  std::ifstream stream("/proc/meminfo");
  int64_t bytes = 0;
  bool is_said = false;
  std::string key, unit;
  for (int64_t kilobytes; stream >> key >> kilobytes;
       std::getline(stream, unit)) {
    if (key != "MemAvailable:" && key != "SwapFree:") continue;
    is_said |= key == "MemAvailable:";
    bytes += 1024 * kilobytes;
  }
  return is_said ? bytes : kUnlimited;
}

// The limit of the control group, whatever it uses at present: that may be
// cache.
int64_t OfControlGroup() {
  for (const char* name : {"/sys/fs/cgroup/memory.max",
                           "/sys/fs/cgroup/memory/memory.limit_in_bytes"}) {
    std::ifstream stream(name);
    if (int64_t bytes; stream >> bytes) return bytes;  // not "max"
  }
  return kUnlimited;
}

struct ProcessPages {
  int64_t of_address_space = 0;
  int64_t resident = 0;
};

ProcessPages PagesOfProcess() {
  ProcessPages pages;
  std::ifstream("/proc/self/statm") >> pages.of_address_space >> pages.resident;
  return pages;
}

int64_t FreeOfAddressSpace() {
  rlimit limit = {};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) {
    return kUnlimited;
  }
  return static_cast<int64_t>(limit.rlim_cur) -
         PagesOfProcess().of_address_space * sysconf(_SC_PAGESIZE);
}

}  // namespace

int EndIfMemoryIsLimited(int exit_code) {
  if (FreeOfAddressSpace() != kUnlimited) std::_Exit(exit_code);
  return exit_code;
}

int64_t FreeMemoryBytes() {
  return std::max<int64_t>(
      0, std::min({FreeOfMachine(), OfControlGroup(), FreeOfAddressSpace()}));
}

int64_t ResidentBytes() {
  return PagesOfProcess().resident * sysconf(_SC_PAGESIZE);
}

int64_t PeakMemoryBytes() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
#ifdef __APPLE__
  return usage.ru_maxrss;  // bytes
#else
  return static_cast<int64_t>(usage.ru_maxrss) * 1024;  // kB
#endif
}

bool IsStderrTerminal() { return ::isatty(STDERR_FILENO) == 1; }

bool CanRewriteLines() {
  const char* term = ::getenv("TERM");
  return IsStderrTerminal() && term != nullptr && *term != '\0' &&
         std::string_view(term) != "dumb";
}

std::optional<int> TerminalColumns() {
  winsize size = {};
  if (::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) {
    return std::nullopt;
  }
  return size.ws_col;
}

// The name after "model name : " in /proc/cpuinfo.
std::string CpuName() {
  std::ifstream stream("/proc/cpuinfo");
  for (std::string line; std::getline(stream, line);) {
    const size_t colon = line.find(": ");
    if (line.rfind("model name", 0) == 0 && colon != std::string::npos) {
      return line.substr(colon + 2);
    }
  }
  return "unknown";
}

std::string SystemName() {
  utsname name;
  if (::uname(&name) != 0) return "unknown";
  return std::string(name.sysname) + " " + name.release + " " + name.machine;
}

double LoadAverage() {
  double load = 0;
  getloadavg(&load, 1);
  return load;
}

}  // namespace krot::internal
