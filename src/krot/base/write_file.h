#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "krot/base/system.h"
#include "krot/context.h"

namespace krot::internal {

// Throws WriteError if WriteFileAtomically would fail because there is no
// folder (unless that is `folder_to_come`, which will exist by then), no
// permission, or something other than a regular file in its place. Changes
// nothing.
void CheckFileWritable(const std::filesystem::path& file,
                       const std::filesystem::path& folder_to_come = {});

// Creates `file` or replaces its content, and forces it to the disk. Throws
// WriteError if it cannot be written in full, which names `final_name`, if that
// is where it will be in the end.
void WriteFile(const std::filesystem::path& file, std::string_view contents,
               const std::filesystem::path& final_name = {});

// Does the same to a new file beside `file`, which is then renamed, so that an
// interruption leaves either the old file or the new one. Throws WriteError.
void WriteFileAtomically(const std::filesystem::path& file,
                         std::string_view contents);

// Forces the names that a folder holds to the disk, so that a rename outlasts a
// power cut. Does nothing for a folder that may not be read. Throws WriteError.
void SyncFolder(const std::filesystem::path& folder);

// The names in a folder, in no particular order. Throws
// std::filesystem::filesystem_error. Where memory runs out, std::filesystem's
// own directory_iterator and remove_all would end the process; these do not.
std::vector<std::filesystem::path> FolderEntries(
    const std::filesystem::path& folder);

// Removes a file, or a folder with all that it holds, if it exists. Does not
// follow links. It does not throw: it returns the first failure, and goes on
// with the rest after it.
std::error_code RemoveTree(const std::filesystem::path& path);

// Throws WriteError if FolderSwap would refuse this target: it is a file, a
// mount point or the working directory (which cannot be replaced under a
// running shell), or it or its nearest existing parent is not writable.
// Changes nothing.
void CheckSwappable(const std::filesystem::path& target);

// Replaces a whole folder at once. A new folder is made beside the target,
// filled by the caller, and exchanged with the target in one system call. So
// the old folder or the new one is there at any time, even if this process
// ends. Only a SIGKILL or a power cut leaves the other folder behind, named
// ".<target>.krot-<process>-<number>"; nobody reads it.
//
//   FolderSwap swap("out");
//   ... write into swap.staging() ...
//   swap.Commit(is_replaced);
//
// Throws WriteError or std::filesystem::filesystem_error; then nothing has
// changed.
class FolderSwap {
 public:
  using Note = std::function<void(const std::string& sentence)>;

  // Creates the staging folder, with the parents that the target lacks; they
  // come into place together with it. `note` receives a sentence if the old
  // folder could not be removed in the end, or if the new one's name could not
  // be forced to the disk; it may be empty.
  explicit FolderSwap(const std::filesystem::path& target, Note note = {});
  // Removes the old folder after Commit, and the new one if there was none.
  ~FolderSwap();
  FolderSwap(const FolderSwap&) = delete;
  FolderSwap& operator=(const FolderSwap&) = delete;

  const std::filesystem::path& staging() const { return staging_; }

  // Carries the old folder's entries over into the new one (files as hard links
  // where possible), except those for which `is_replaced` is true and those
  // that the new folder has already. Then forces the new folder's names to the
  // disk, and exchanges the folders.
  void Commit(const std::function<bool(const std::filesystem::path& file_name)>&
                  is_replaced);

 private:
  FolderSwap() = default;
  void MoveIntoPlace();
  void SyncPlace() const;

  Note note_;
  // What is renamed: the target, or its topmost parent that did not exist.
  std::filesystem::path target_;
  bool is_new_ = false;  // it did not exist
  // The new folder beside target_; after Commit the old one, if there was one.
  std::filesystem::path sibling_;
  // sibling_, or the folder in it that will become the target.
  std::filesystem::path staging_;
};

}  // namespace krot::internal
