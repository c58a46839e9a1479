#include "krot/pipeline/solve_model.h"

#include <cerrno>
#include <cstring>
#include <system_error>

#include "krot/convert/certificate_file.h"

namespace krot::internal {
namespace {

constexpr char kMagic[] = "krot checkpoint 1\n";
constexpr size_t kDigestSize = 64;

std::string Reason() { return std::generic_category().message(errno); }

[[noreturn]] void ThrowNotRead(const std::string& name) {
  throw CheckpointError(name + ": cannot be read: " + Reason());
}

[[noreturn]] void ThrowNotWritten(const std::string& name) {
  throw WriteError(name + ": cannot be written: " + Reason());
}

}  // namespace

CheckpointFile::CheckpointFile(const std::filesystem::path& file,
                               const std::string& run)
    : name_(file.string()),
      descriptor_((CheckFileWritable(file), file),
                  FileDescriptor::Use::kUpdate) {
  if (!descriptor_.is_open()) ThrowNotWritten(name_);
  if (!descriptor_.Lock()) {
    throw CheckpointError(name_ + ": another run writes this checkpoint");
  }
  const std::string head = kMagic + run + "\n";
  const std::string found = ReadAt(0, head.size());
  if (found == head.substr(0, found.size())) {
    // The file is of this run, or empty, or its head was written in part.
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

// Returns fewer than `size` bytes if the file ends before.
std::string CheckpointFile::ReadAt(int64_t offset, size_t size) const {
  std::string bytes;
  if (!descriptor_.ReadAt(offset, size, &bytes)) ThrowNotRead(name_);
  return bytes;
}

// Reads the record at offset_: its size, its digest and its bytes.
std::optional<std::string> CheckpointFile::ReadRecord() {
  uint64_t size = 0;
  constexpr size_t kHeadSize = sizeof(size) + kDigestSize;
  const std::string head = ReadAt(offset_, kHeadSize);
  if (head.size() < kHeadSize) return std::nullopt;
  std::memcpy(&size, head.data(), sizeof(size));
  const int64_t begin = offset_ + static_cast<int64_t>(kHeadSize);
  const std::optional<int64_t> file_size = descriptor_.RegularSize();
  if (!file_size) ThrowNotRead(name_);
  if (size > static_cast<uint64_t>(*file_size - begin)) return std::nullopt;
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

// Writes the parts at offset_, after cutting off whatever follows there.
void CheckpointFile::WriteBehind(
    std::initializer_list<std::string_view> parts) {
  is_broken_ = true;
  bool is_written = descriptor_.Truncate(offset_);
  int64_t offset = offset_;
  for (const std::string_view part : parts) {
    is_written = is_written && descriptor_.Write(part);
    offset += static_cast<int64_t>(part.size());
  }
  if (!is_written || !descriptor_.Sync()) ThrowNotWritten(name_);
  offset_ = offset;
  is_broken_ = false;
}

}  // namespace krot::internal
