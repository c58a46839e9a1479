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

// A checkpoint in a file (docs/formats.md). A step counts once it is there as a
// whole, with its digest: what was being written when the process was killed or
// the power cut is as if it were not there.
class CheckpointFile : public Checkpoint {
 public:
  // Opens the file for this process alone, or begins it if there is none.
  // `run` is a digest of what is computed. Throws CheckpointError for a file
  // of another run, of another kind, or that another process has open,
  // WriteError if it cannot be written.
  CheckpointFile(const std::filesystem::path& file, const std::string& run);

  // Steps that it held when it was opened.
  int64_t num_steps() const { return num_steps_; }

  std::optional<std::string> Next() override;
  // Forces the step to the disk. After a failure it keeps no more.
  void Append(const std::string& record) override;

 private:
  std::string ReadAt(int64_t offset, size_t size) const;
  std::optional<std::string> ReadRecord();
  void WriteBehind(std::initializer_list<std::string_view> parts);

  const std::string name_;
  FileDescriptor descriptor_;
  int64_t num_steps_ = 0;
  int64_t offset_ = 0;      // behind the last step that was given or appended
  bool is_past_ = false;    // all steps that it held are given
  bool is_broken_ = false;  // it could not be written
};

}  // namespace krot::internal
