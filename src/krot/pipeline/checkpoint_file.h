#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

#include "krot/base/checkpoint.h"
#include "krot/base/write_file.h"

namespace krot::internal {

// A checkpoint in a file (docs/formats.md). A step counts only if its whole
// record is in the file and matches its digest. So a record that was being
// written when the process was killed or the power failed is ignored.
class CheckpointFile : public Checkpoint {
 public:
  // Opens the file for this process alone, or creates it if there is none.
  // `run` is a digest of what is computed. Throws CheckpointError if the file
  // belongs to another run, is no checkpoint, or is open in another process;
  // throws WriteError if it cannot be written.
  CheckpointFile(const std::filesystem::path& file, const std::string& run);

  // The number of steps that the file held when it was opened.
  int64_t num_steps() const { return num_steps_; }

  std::optional<std::string> Next() override;
  // Forces the record to the disk. After a failure, later calls do nothing.
  void Append(const std::string& record) override;

 private:
  std::string ReadAt(int64_t offset, size_t size) const;
  std::optional<std::string> ReadRecord();
  void WriteBehind(std::initializer_list<std::string_view> parts);

  const std::string name_;
  FileDescriptor descriptor_;
  int64_t num_steps_ = 0;
  int64_t offset_ = 0;      // end of the last record read or appended
  bool is_past_ = false;    // all records that the file held have been read
  bool is_broken_ = false;  // writing has failed
};

}  // namespace krot::internal
