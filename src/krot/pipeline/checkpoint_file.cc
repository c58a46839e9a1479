#include "krot/pipeline/checkpoint_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "krot/bridge/model_digest.h"

namespace krot {
namespace {

constexpr char kMagic[] = "krot checkpoint 1\n";
constexpr size_t kDigestSize = 64;

int OpenAlone(const std::string& name) {
  CheckFileWritable(name);
  return ::open(name.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, mode_t{0666});
}

[[noreturn]] void ThrowNotWritten(const std::string& name) {
  throw WriteError(
      name + ": cannot be written: " + std::generic_category().message(errno));
}

// As many bytes as there are, up to `size`.
std::string ReadAt(const FileDescriptor& descriptor, int64_t offset,
                   size_t size) {
  std::string bytes(size, '\0');
  size_t done = 0;
  while (done < size) {
    const ssize_t result =
        ::pread(descriptor.get(), bytes.data() + done, size - done,
                offset + static_cast<int64_t>(done));
    if (result < 0 && errno == EINTR) continue;
    if (result <= 0) break;
    done += static_cast<size_t>(result);
  }
  bytes.resize(done);
  return bytes;
}

int64_t SizeOf(const FileDescriptor& descriptor) {
  struct stat status = {};
  return ::fstat(descriptor.get(), &status) == 0 ? status.st_size : 0;
}

}  // namespace

CheckpointFile::CheckpointFile(const std::filesystem::path& file,
                               const std::string& run)
    : name_(file.string()), descriptor_(OpenAlone(name_)) {
  if (!descriptor_.is_open()) ThrowNotWritten(name_);
  if (::flock(descriptor_.get(), LOCK_EX | LOCK_NB) != 0) {
    throw CheckpointError(name_ + ": another run writes this checkpoint");
  }
  const std::string head = kMagic + run + "\n";
  const std::string found = ReadAt(descriptor_, 0, head.size());
  if (found == head.substr(0, found.size())) {
    // Its own, or begun, or empty.
    if (found.size() < head.size()) WriteBehind(head);
    offset_ = static_cast<int64_t>(head.size());
  } else if (found.compare(0, sizeof(kMagic) - 1, kMagic) == 0) {
    throw CheckpointError(
        name_ +
        ": this checkpoint is of another run: model, options or version of "
        "KROT differ; remove it, or name another file");
  } else {
    throw CheckpointError(name_ + ": this is no checkpoint of KROT");
  }
  const int64_t begin = offset_;
  while (ReadRecord()) ++num_steps_;
  offset_ = begin;
}

// A record is its size, its digest and its bytes.
std::optional<std::string> CheckpointFile::ReadRecord() {
  uint64_t size = 0;
  constexpr size_t kHeadSize = sizeof(size) + kDigestSize;
  const std::string head = ReadAt(descriptor_, offset_, kHeadSize);
  if (head.size() < kHeadSize) return std::nullopt;
  std::memcpy(&size, head.data(), sizeof(size));
  const int64_t begin = offset_ + static_cast<int64_t>(kHeadSize);
  if (size > static_cast<uint64_t>(SizeOf(descriptor_) - begin)) {
    return std::nullopt;
  }
  std::string record = ReadAt(descriptor_, begin, size);
  if (Sha256(record) != head.substr(sizeof(size))) return std::nullopt;
  offset_ = begin + static_cast<int64_t>(size);
  return record;
}

std::optional<std::string> CheckpointFile::Next() {
  if (is_past_) return std::nullopt;
  std::optional<std::string> record = ReadRecord();
  is_past_ = !record;
  return record;
}

void CheckpointFile::Append(const std::string& record) {
  if (is_broken_) return;
  const auto size = static_cast<uint64_t>(record.size());
  std::string head(reinterpret_cast<const char*>(&size), sizeof(size));
  head += Sha256(record);
  WriteBehind(head + record);
}

// And nothing behind that.
void CheckpointFile::WriteBehind(const std::string& bytes) {
  is_broken_ = true;
  if (::ftruncate(descriptor_.get(), offset_) != 0) ThrowNotWritten(name_);
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t result =
        ::pwrite(descriptor_.get(), bytes.data() + done, bytes.size() - done,
                 offset_ + static_cast<int64_t>(done));
    if (result < 0 && errno == EINTR) continue;
    if (result < 0) ThrowNotWritten(name_);
    done += static_cast<size_t>(result);
  }
  // File systems without fsync answer EINVAL.
  if (::fsync(descriptor_.get()) != 0 && errno != EINVAL) {
    ThrowNotWritten(name_);
  }
  offset_ += static_cast<int64_t>(bytes.size());
  is_broken_ = false;
}

}  // namespace krot
