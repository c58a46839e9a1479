#include <windows.h>
// These must follow windows.h, as they need its types.
#include <fcntl.h>
#include <io.h>
#include <process.h>
#include <psapi.h>
#include <shellapi.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <codecvt>
#include <cstdlib>
#include <limits>
#include <memory>

#include "krot/base/system.h"

// Makes std::filesystem read narrow texts as UTF-8. libstdc++ converts paths by
// this facet; in the locale "C" its own functions take every byte for a letter,
// and msvcrt.dll has no UTF-8 locale. The functions below replace all of the
// facet's.
namespace std {

using ByUtf8 = codecvt_utf8_utf16<wchar_t>;
using OfLocale = codecvt<wchar_t, char, mbstate_t>;

codecvt_base::result OfLocale::do_out(state_type& state, const wchar_t* from,
                                      const wchar_t* from_end,
                                      const wchar_t*& from_next, char* to,
                                      char* to_end, char*& to_next) const {
  return ByUtf8().out(state, from, from_end, from_next, to, to_end, to_next);
}
// Bytes that are not UTF-8 become U+FFFD, so they name no existing file.
codecvt_base::result OfLocale::do_in(state_type& state, const char* from,
                                     const char* from_end,
                                     const char*& from_next, wchar_t* to,
                                     wchar_t* to_end, wchar_t*& to_next) const {
  for (;;) {
    const result done =
        ByUtf8().in(state, from, from_end, from_next, to, to_end, to_next);
    if (done != error || to_next == to_end) return done;
    *to_next++ = L'\xFFFD';
    from = ++from_next;
    to = to_next;
  }
}
int OfLocale::do_length(state_type& state, const char* from, const char* end,
                        size_t max) const {
  return ByUtf8().length(state, from, end, max);
}
int OfLocale::do_encoding() const noexcept { return ByUtf8().encoding(); }
int OfLocale::do_max_length() const noexcept { return ByUtf8().max_length(); }

}  // namespace std

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

constexpr int kStderr = 2;

int Open(const fs::path& file, FileDescriptor::Use use) {
  int flags = _O_RDONLY;
  if (use == FileDescriptor::Use::kReplace) {
    flags = _O_WRONLY | _O_CREAT | _O_TRUNC;
  } else if (use == FileDescriptor::Use::kUpdate) {
    flags = _O_RDWR | _O_CREAT;
  }
  return ::_wopen(file.c_str(), flags | _O_BINARY | _O_NOINHERIT,
                  _S_IREAD | _S_IWRITE);
}

// One system call cannot take more bytes than this.
unsigned int OneCall(size_t size) {
  return static_cast<unsigned int>(std::min<size_t>(size, 1 << 30));
}

bool WriteAll(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const int result =
        ::_write(descriptor, bytes.data(), OneCall(bytes.size()));
    if (result < 0) return false;
    bytes.remove_prefix(static_cast<size_t>(result));
  }
  return true;
}

HANDLE StderrHandle() { return ::GetStdHandle(STD_ERROR_HANDLE); }

}  // namespace

FileDescriptor::FileDescriptor(const fs::path& file, Use use)
    : value_(Open(file, use)) {}

std::optional<int64_t> FileDescriptor::RegularSize() const {
  struct _stat64 status = {};
  if (::_fstat64(value_, &status) != 0) return std::nullopt;
  if ((status.st_mode & _S_IFMT) != _S_IFREG) {
    errno = EINVAL;
    return std::nullopt;
  }
  return status.st_size;
}

bool FileDescriptor::ReadAt(int64_t offset, size_t size,
                            std::string* bytes) const {
  if (::_lseeki64(value_, offset, SEEK_SET) < 0) return false;
  bytes->resize(size);
  size_t done = 0;
  while (done < size) {
    const int result =
        ::_read(value_, bytes->data() + done, OneCall(size - done));
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
  return ::_chsize_s(value_, size) == 0 &&
         ::_lseeki64(value_, size, SEEK_SET) >= 0;
}

bool FileDescriptor::Sync() const { return ::_commit(value_) == 0; }

// Locks one byte far behind the end, because nobody else could read locked
// bytes.
bool FileDescriptor::Lock() const {
  OVERLAPPED place = {};
  place.OffsetHigh = 0x7FFFFFFF;
  return ::LockFileEx(reinterpret_cast<HANDLE>(::_get_osfhandle(value_)),
                      LOCKFILE_EXCLUSIVE_LOCK | LOCKFILE_FAIL_IMMEDIATELY, 0, 1,
                      0, &place) != 0;
}

bool FileDescriptor::Close() {
  const int value = value_;
  value_ = -1;
  return ::_close(value) == 0;
}

std::error_code TryToCreateIn(const fs::path& folder) {
  const fs::path named = folder / (".krot-" + std::to_string(ProcessId()));
  std::error_code error;
  fs::create_directory(named, error);
  if (!error) fs::remove(named, error);
  return error;
}

// Nothing to do: NTFS keeps a log of names.
std::error_code SyncEntries(const fs::path&) { return {}; }

// A folder's attribute "read-only" says nothing about its entries.
std::error_code CheckPermissions(const fs::path&) { return {}; }

bool IsMountPoint(const fs::path&) { return false; }

std::error_code ExchangeNames(const fs::path&, const fs::path&) {
  return std::make_error_code(std::errc::function_not_supported);
}

std::vector<std::string> ProgramArguments(int, char**) {
  static UINT code_page = 0;
  code_page = ::GetConsoleOutputCP();
  if (code_page != 0) {
    ::SetConsoleOutputCP(CP_UTF8);
    std::atexit([] { ::SetConsoleOutputCP(code_page); });
  }
  ::_setmode(1, _O_BINARY);
  ::_setmode(kStderr, _O_BINARY);
  int count = 0;
  const std::unique_ptr<wchar_t*, HLOCAL(WINAPI*)(HLOCAL)> words(
      ::CommandLineToArgvW(::GetCommandLineW(), &count), &::LocalFree);
  std::vector<std::string> arguments;
  for (int n = 1; n < count; ++n) {
    // fs::path keeps the characters, and converts them to UTF-8.
    arguments.push_back(fs::path(words.get()[n]).string());
  }
  return arguments;
}

int ProcessId() { return ::_getpid(); }

namespace {

void (*on_end_request)() = nullptr;
bool is_once = false;

BOOL WINAPI HandleConsole(DWORD) {
  // The default handler then ends the process.
  if (on_end_request == nullptr) return FALSE;
  void (*const handler)() = on_end_request;
  if (is_once) on_end_request = nullptr;
  handler();
  return TRUE;
}

}  // namespace

void OnEndRequest(void (*handler)(), bool once) {
  on_end_request = handler;
  is_once = once;
  static const BOOL is_set = ::SetConsoleCtrlHandler(&HandleConsole, TRUE);
  static_cast<void>(is_set);
}

void OnFork(void (*)()) {}  // there is no fork

bool WriteToStderr(std::string_view text) { return WriteAll(kStderr, text); }

int EndIfMemoryIsLimited(int exit_code) { return exit_code; }

int64_t FreeMemoryBytes() {
  MEMORYSTATUSEX status = {};
  status.dwLength = sizeof(status);
  if (::GlobalMemoryStatusEx(&status) == 0) {
    return std::numeric_limits<int64_t>::max();
  }
  // ullAvailPageFile includes physical memory.
  return static_cast<int64_t>(
      std::min(status.ullAvailPageFile, status.ullAvailVirtual));
}

namespace {

PROCESS_MEMORY_COUNTERS MemoryCounters() {
  PROCESS_MEMORY_COUNTERS counters = {};
  ::GetProcessMemoryInfo(::GetCurrentProcess(), &counters, sizeof(counters));
  return counters;
}

}  // namespace

int64_t ResidentBytes() {
  return static_cast<int64_t>(MemoryCounters().WorkingSetSize);
}

int64_t PeakMemoryBytes() {
  return static_cast<int64_t>(MemoryCounters().PeakWorkingSetSize);
}

bool IsStderrTerminal() {
  DWORD mode = 0;
  return ::GetConsoleMode(StderrHandle(), &mode) != 0;
}

bool CanRewriteLines() { return IsStderrTerminal(); }

std::optional<int> TerminalColumns() {
  CONSOLE_SCREEN_BUFFER_INFO info;
  if (::GetConsoleScreenBufferInfo(StderrHandle(), &info) == 0) {
    return std::nullopt;
  }
  return info.srWindow.Right - info.srWindow.Left + 1;
}

std::string CpuName() {
  const char* name = std::getenv("PROCESSOR_IDENTIFIER");
  return name == nullptr ? "unknown" : name;
}

std::string SystemName() {
  OSVERSIONINFOEXW version = {};
  version.dwOSVersionInfoSize = sizeof(version);
  using RtlGetVersion = LONG(WINAPI*)(OSVERSIONINFOEXW*);
  const auto get_version =
      reinterpret_cast<RtlGetVersion>(reinterpret_cast<void*>(
          ::GetProcAddress(::GetModuleHandleW(L"ntdll.dll"), "RtlGetVersion")));
  if (get_version == nullptr || get_version(&version) != 0) return "unknown";
  return "Windows " + std::to_string(version.dwMajorVersion) + "." +
         std::to_string(version.dwMinorVersion) + "." +
         std::to_string(version.dwBuildNumber);
}

double LoadAverage() { return 0; }

}  // namespace krot::internal
