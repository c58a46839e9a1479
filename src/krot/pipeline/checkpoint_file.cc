#include "krot/pipeline/checkpoint_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "krot/convert/model_digest.h"

namespace krot::internal {
namespace {

constexpr char kMagic[] = "krot checkpoint 1\n";
constexpr size_t kDigestSize = 64;

int OpenAlone(const std::string& name) {
  CheckFileWritable(name);
  return ::open(name.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, mode_t{0666});
}

std::string Reason() { return std::generic_category().message(errno); }

[[noreturn]] void ThrowNotRead(const std::string& name) {
  throw CheckpointError(name + ": cannot be read: " + Reason());
}

[[noreturn]] void ThrowNotWritten(const std::string& name) {
  throw WriteError(
      name + ": cannot be written: " + std::generic_category().message(errno));
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
  const std::string found = ReadAt(0, head.size());
  if (found == head.substr(0, found.size())) {
    // Its own, or begun, or empty.
    if (found.size() < head.size()) WriteBehind({head});
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

// As many bytes as there are, up to `size`.
std::string CheckpointFile::ReadAt(int64_t offset, size_t size) const {
  std::string bytes(size, '\0');
  size_t done = 0;
  while (done < size) {
    const ssize_t result =
        ::pread(descriptor_.get(), bytes.data() + done, size - done,
                offset + static_cast<int64_t>(done));
    if (result < 0 && errno == EINTR) continue;
    if (result < 0) ThrowNotRead(name_);
    if (result == 0) break;
    done += static_cast<size_t>(result);
  }
  bytes.resize(done);
  return bytes;
}

// A record is its size, its digest and its bytes.
std::optional<std::string> CheckpointFile::ReadRecord() {
  uint64_t size = 0;
  constexpr size_t kHeadSize = sizeof(size) + kDigestSize;
  const std::string head = ReadAt(offset_, kHeadSize);
  if (head.size() < kHeadSize) return std::nullopt;
  std::memcpy(&size, head.data(), sizeof(size));
  const int64_t begin = offset_ + static_cast<int64_t>(kHeadSize);
  struct stat status = {};
  if (::fstat(descriptor_.get(), &status) != 0) ThrowNotRead(name_);
  if (size > static_cast<uint64_t>(status.st_size - begin)) return std::nullopt;
  std::string record = ReadAt(begin, size);
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
  WriteBehind({head, record});
}

// And nothing behind that.
void CheckpointFile::WriteBehind(
    std::initializer_list<std::string_view> parts) {
  is_broken_ = true;
  if (::ftruncate(descriptor_.get(), offset_) != 0) ThrowNotWritten(name_);
  int64_t offset = offset_;
  for (std::string_view part : parts) {
    while (!part.empty()) {
      const ssize_t result =
          ::pwrite(descriptor_.get(), part.data(), part.size(), offset);
      if (result < 0 && errno == EINTR) continue;
      if (result < 0) ThrowNotWritten(name_);
      offset += result;
      part.remove_prefix(static_cast<size_t>(result));
    }
  }
  // File systems without fsync answer EINVAL.
  if (::fsync(descriptor_.get()) != 0 && errno != EINVAL) {
    ThrowNotWritten(name_);
  }
  offset_ = offset;
  is_broken_ = false;
}

}  // namespace krot::internal
