#include "krot/model/file_bytes.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string_view>
#include <system_error>

#include "krot/base/write_file.h"
#include "krot/context.h"

namespace krot::internal {
namespace {

[[noreturn]] void FailWithErrno(const std::string& path, const char* action) {
  const std::string reason = std::generic_category().message(errno);
  throw ModelError(path + ": cannot be " + action + ": " + reason);
}

bool IsLfsPointer(std::string_view bytes) {
  constexpr std::string_view kSignature =
      "version https://git-lfs.github.com/spec/";
  return bytes.substr(0, kSignature.size()) == kSignature;
}

}  // namespace

FileBytes ReadFileBytes(const std::filesystem::path& path) {
  FileBytes file;
  file.path = path.string();
  const FileDescriptor descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!descriptor.is_open()) FailWithErrno(file.path, "opened");

  struct stat status;
  if (::fstat(descriptor.get(), &status) != 0) {
    FailWithErrno(file.path, "read");
  }
  if (!S_ISREG(status.st_mode)) {
    throw ModelError(file.path + ": not a regular file, expected a model file");
  }

  file.bytes.resize(static_cast<size_t>(status.st_size));
  size_t num_read = 0;
  while (num_read < file.bytes.size()) {
    const ssize_t result =
        ::read(descriptor.get(), file.bytes.data() + num_read,
               file.bytes.size() - num_read);
    if (result < 0 && errno == EINTR) continue;
    if (result < 0) FailWithErrno(file.path, "read");
    if (result == 0) break;  // it shrank since fstat
    num_read += static_cast<size_t>(result);
  }
  file.bytes.resize(num_read);

  if (IsLfsPointer(file.bytes)) {
    throw ModelError(file.path +
                     ": is a Git LFS pointer, not a model; run `git lfs pull` "
                     "where it was cloned");
  }
  return file;
}

}  // namespace krot::internal
