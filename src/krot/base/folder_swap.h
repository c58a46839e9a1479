#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace krot {

// Throws WriteError if FolderSwap would refuse this target: it is a file, a
// mount point or the working directory (which cannot be replaced under a
// running shell), or it or its nearest existing parent is not writable.
// Changes nothing.
void CheckSwappable(const std::filesystem::path& target);

// Replaces a whole folder at once. A new folder is made beside the target,
// filled by the caller, and exchanged with the target in one system call, so
// that whoever looks, and whenever this process ends, finds the old folder or
// the new one. Only a SIGKILL or a power cut leaves the sibling behind, named
// ".<target>.krot-<process>-<number>"; nobody reads it.
//
//   FolderSwap swap("out");
//   ... write into swap.staging() ...
//   swap.Commit(is_replaced);
//
// Throws WriteError or std::filesystem::filesystem_error; nothing has changed
// then.
class FolderSwap {
 public:
  using Note = std::function<void(const std::string& sentence)>;

  // Creates the staging folder. Parents that the target lacks are created in
  // it and come into place with it. `note` takes a sentence
  // where the old folder could not be removed in the end, or the new one's name
  // not be forced to the disk; may be empty.
  explicit FolderSwap(const std::filesystem::path& target, Note note = {});
  // Removes the old folder after Commit, the new one without.
  ~FolderSwap();
  FolderSwap(const FolderSwap&) = delete;
  FolderSwap& operator=(const FolderSwap&) = delete;

  const std::filesystem::path& staging() const { return staging_; }

  // Carries the old folder's entries over into the new one (files as hard
  // links where possible), except those for which `is_replaced` is true or
  // that the new folder has already; then forces the new one's to the disk, and
  // swaps.
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

}  // namespace krot
