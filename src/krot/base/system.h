#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace krot::internal {

// What is asked of the operating system in a way of its own: system_posix.cc
// and system_windows.cc. Texts are UTF-8 on both.

// An open file that is closed when it goes out of scope, and that no child
// process inherits. What fails leaves the reason in errno.
class FileDescriptor {
 public:
  enum class Use {
    kRead,
    kReplace,  // write; what the file held is gone
    kUpdate,   // read and write
  };
  // kReplace and kUpdate create a file that is not there.
  FileDescriptor(const std::filesystem::path& file, Use use);
  ~FileDescriptor() {
    if (is_open()) Close();
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;

  bool is_open() const { return value_ >= 0; }
  // In bytes; none if it is a folder, a pipe or a device, or on failure.
  std::optional<int64_t> RegularSize() const;
  // Reads on from `offset`: `size` bytes, or as many as there are.
  bool ReadAt(int64_t offset, size_t size, std::string* bytes) const;
  // All of them, from where Truncate or the last Write ended.
  bool Write(std::string_view bytes) const;
  // Leaves `size` bytes, and writes on behind them.
  bool Truncate(int64_t size) const;
  // Forces what was written to the disk, where there is one.
  bool Sync() const;
  // Keeps other processes from locking it; false if one has.
  bool Lock() const;
  // Fails if earlier writes did not reach the file.
  bool Close();

 private:
  int value_;
};

// Folders.

// Why nothing can be created in `folder`; no error if something can. It is
// tried, since permissions tell root nothing of /proc or of a read-only disk;
// nothing stays.
std::error_code TryToCreateIn(const std::filesystem::path& folder);
// Appends the names that a folder holds, in no order.
std::error_code ListEntries(const std::filesystem::path& folder,
                            std::vector<std::filesystem::path>* names);
// Removes a file, a link or an empty folder.
std::error_code RemoveEntry(const std::filesystem::path& path);
// Forces the names that a folder holds to the disk, where that is for programs
// to do and the folder may be read.
std::error_code SyncEntries(const std::filesystem::path& folder);
// Why the entries of `folder` may be neither listed nor changed, as far as its
// permissions tell.
std::error_code CheckPermissions(const std::filesystem::path& folder);
// False where the system cannot tell.
bool IsMountPoint(const std::filesystem::path& folder);
// Exchanges two names in one step. errc::function_not_supported where the
// system or the file system has no such step.
std::error_code ExchangeNames(const std::filesystem::path& a,
                              const std::filesystem::path& b);

// The process.

// The arguments behind the program's name. To be called once, first of all: on
// Windows the console is told that texts are UTF-8, and stdout that lines end
// as they are written.
std::vector<std::string> ProgramArguments(int argc, char** argv);
int ProcessId();
// What happens on Ctrl-C or when the process is asked to end (SIGINT, SIGTERM):
// `handler` is called in a signal handler, or on Windows on a thread of its
// own, and may do what is allowed in the former. With `once`, the next request
// ends the process.
void OnEndRequest(void (*handler)(), bool once);
// Calls `function` in every child process that is forked off.
void OnFork(void (*function)());
// Writes to stderr as it is, also in a signal handler; false if that fails.
bool WriteToStderr(std::string_view text);

// Bytes that this process can still take: what is left of the machine's memory
// and swap, of its control group's and of its own address space, the least of
// them. What the system does not say sets no limit.
int64_t FreeMemoryBytes();
int64_t ResidentBytes();  // now
int64_t PeakMemoryBytes();

// The terminal.

bool IsStderrTerminal();
// Whether it lets lines be rewritten by control sequences.
bool CanRewriteLines();
std::optional<int> TerminalColumns();

// The machine; "unknown" and 0 where the system does not say.

std::string CpuName();
std::string SystemName();
double LoadAverage();  // runnable processes, mean of the last minute

}  // namespace krot::internal
