#include "krot/base/write_file.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <memory>
#include <new>
#include <string_view>
#include <utility>

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

std::error_code LastError() { return {errno, std::generic_category()}; }

std::error_code ListEntries(const fs::path& folder,
                            std::vector<fs::path>* names) {
  const std::unique_ptr<DIR, int (*)(DIR*)> stream(::opendir(folder.c_str()),
                                                   &::closedir);
  if (!stream) return LastError();
  for (;;) {
    errno = 0;
    const dirent* entry = ::readdir(stream.get());
    if (entry == nullptr) break;
    const std::string_view name = entry->d_name;
    if (name != "." && name != "..") names->emplace_back(name);
  }
  return errno == 0 ? std::error_code() : LastError();
}

// The path that rename acts on: without symbolic links, dots and a trailing
// slash.
fs::path Resolve(const fs::path& target) {
  if (target.empty()) throw WriteError("found no name of an output folder");
  const fs::path resolved = fs::weakly_canonical(fs::absolute(target));
  return resolved.has_filename() ? resolved : resolved.parent_path();
}

std::string Reason(int error) { return std::generic_category().message(error); }

// False where the system cannot tell.
bool IsMountPoint([[maybe_unused]] const fs::path& folder) {
#ifdef STATX_ATTR_MOUNT_ROOT
  struct statx status;
  return ::statx(AT_FDCWD, folder.c_str(), 0, 0, &status) == 0 &&
         (status.stx_attributes & STATX_ATTR_MOUNT_ROOT) != 0;
#else
  return false;
#endif
}

// Exchanges two names in one step. Returns false, with errno, where the system
// or the file system cannot do that.
bool ExchangeNames([[maybe_unused]] const fs::path& a,
                   [[maybe_unused]] const fs::path& b) {
#ifdef RENAME_EXCHANGE
  return ::renameat2(AT_FDCWD, a.c_str(), AT_FDCWD, b.c_str(),
                     RENAME_EXCHANGE) == 0;
#else
  errno = ENOSYS;
  return false;
#endif
}

// `path`, or its nearest parent that exists.
fs::path ExistingPart(fs::path path) {
  while (!fs::exists(path)) path = path.parent_path();
  return path;
}

bool HoldsWorkingDirectory(const fs::path& folder) {
  const fs::path inside = fs::current_path().lexically_relative(folder);
  return !inside.empty() && *inside.begin() != "..";
}

void CheckFolderIsWritable(const fs::path& folder) {
  if (!fs::is_directory(folder)) {
    throw WriteError(folder.string() + ": is a file, expected a folder");
  }
  if (::access(folder.c_str(), R_OK | W_OK | X_OK) != 0) {
    throw WriteError(folder.string() +
                     ": cannot be written to: " + Reason(errno));
  }
  if (const std::error_code error = TryToCreateIn(folder)) {
    throw WriteError(folder.string() +
                     ": cannot be written to: " + error.message());
  }
}

// A new folder beside `target`, with the permissions that mkdir gives.
fs::path CreateSibling(const fs::path& target) {
  for (int i = 0;; ++i) {
    const std::string name = "." + target.filename().string() + ".krot-" +
                             std::to_string(::getpid()) + "-" +
                             std::to_string(i);
    fs::path sibling = target.parent_path() / name;
    if (fs::create_directory(sibling)) return sibling;
  }
}

// Makes `to` the same as `from`: a file by a hard link, or by a copy where the
// file system has no hard links, a folder entry by entry.
void Carry(const fs::path& from, const fs::path& to) {
  const fs::file_status status = fs::symlink_status(from);
  if (fs::is_directory(status)) {
    // Removing the old folder would empty the mounted file system.
    if (IsMountPoint(from)) {
      throw WriteError(from.string() +
                       ": is a mount point inside the folder to be replaced; "
                       "choose another folder");
    }
    fs::create_directory(to, from);  // with its permissions
    for (const fs::path& name : FolderEntries(from)) {
      Carry(from / name, to / name);
    }
    return;
  }
  std::error_code no_link;
  fs::create_hard_link(from, to, no_link);
  if (!no_link) return;
  fs::copy(from, to, fs::copy_options::copy_symlinks);
}

// Exchanges two folders and returns the path at which the old one is now. File
// systems without RENAME_EXCHANGE need two renames; the first gives the old
// folder a name of its own, which it keeps.
fs::path Exchange(const fs::path& staging, const fs::path& target) {
  if (ExchangeNames(staging, target)) return staging;
  if (errno != EINVAL && errno != ENOSYS) {
    throw WriteError(target.string() +
                     ": cannot be replaced: " + Reason(errno));
  }
  const fs::path old = staging.string() + "-old";
  fs::rename(target, old);
  std::error_code error;
  fs::rename(staging, target, error);
  if (error) {
    fs::rename(old, target);
    throw WriteError(target.string() +
                     ": cannot be replaced: " + error.message());
  }
  return old;
}

}  // namespace

std::vector<fs::path> FolderEntries(const fs::path& folder) {
  std::vector<fs::path> names;
  if (const std::error_code error = ListEntries(folder, &names)) {
    throw fs::filesystem_error("cannot be listed", folder, error);
  }
  return names;
}

std::error_code RemoveTree(const fs::path& path) try {
  std::error_code failure;
  const fs::file_status status = fs::symlink_status(path, failure);
  if (status.type() == fs::file_type::not_found) return {};
  if (fs::is_directory(status)) {
    std::vector<fs::path> names;
    failure = ListEntries(path, &names);
    for (const fs::path& name : names) {
      const std::error_code error = RemoveTree(path / name);
      if (!failure) failure = error;
    }
  }
  if (::remove(path.c_str()) != 0 && !failure) failure = LastError();
  return failure;
} catch (const std::bad_alloc&) {
  return std::make_error_code(std::errc::not_enough_memory);
}

void CheckSwappable(const fs::path& target) {
  const fs::path resolved = Resolve(target);
  const fs::path existing = ExistingPart(resolved);
  if (existing == resolved) {
    if (IsMountPoint(resolved)) {
      throw WriteError(resolved.string() +
                       ": is a mount point, which cannot be replaced; choose a "
                       "folder inside it");
    }
    if (HoldsWorkingDirectory(resolved)) {
      throw WriteError(resolved.string() +
                       ": is or holds the working directory, which cannot be "
                       "replaced; choose another folder or start elsewhere");
    }
    CheckFolderIsWritable(resolved.parent_path());
  }
  CheckFolderIsWritable(existing);
}

FolderSwap::FolderSwap(const fs::path& target, Note note) : FolderSwap() {
  note_ = std::move(note);
  CheckSwappable(target);
  const fs::path resolved = Resolve(target);
  target_ = resolved;
  while (!fs::exists(target_.parent_path())) target_ = target_.parent_path();
  is_new_ = !fs::exists(target_);
  sibling_ = CreateSibling(target_);
  staging_ = sibling_;
  if (target_ != resolved) staging_ /= resolved.lexically_relative(target_);
  fs::create_directories(staging_);
}

FolderSwap::~FolderSwap() {
  if (sibling_.empty()) return;
  const std::error_code error = RemoveTree(sibling_);
  if (!error || !note_) return;
  try {
    note_(sibling_.string() + " cannot be removed: " + error.message());
  } catch (const std::bad_alloc&) {
    // There is no memory left for the sentence.
  }
}

// The new folder is in place, so a failure here is only worth a note.
void FolderSwap::SyncPlace() const {
  try {
    SyncFolder(target_.parent_path());
  } catch (const WriteError& error) {
    if (note_) note_(error.what());
  }
}

// Renames the staging folder to a target that did not exist. Where somebody
// else has created some of its parents meanwhile, only what is missing below
// them is moved.
void FolderSwap::MoveIntoPlace() {
  const fs::path inner = staging_.lexically_relative(sibling_);
  fs::path from = sibling_;
  fs::path to = target_;
  auto next = inner.begin();
  for (;;) {
    std::error_code error;
    fs::rename(from, to, error);
    if (!error) break;
    const bool is_taken = error == std::errc::directory_not_empty ||
                          error == std::errc::file_exists;
    if (!is_taken || from == staging_) {
      throw WriteError(to.string() + ": cannot be created: " + error.message());
    }
    from /= *next;
    to /= *next++;
  }
  SyncPlace();
}

void FolderSwap::Commit(
    const std::function<bool(const fs::path& file_name)>& is_replaced) {
  if (is_new_) {
    SyncFolder(staging_);
    MoveIntoPlace();
    return;
  }
  for (const fs::path& name : FolderEntries(target_)) {
    if (is_replaced(name) || fs::exists(staging_ / name)) continue;
    Carry(target_ / name, staging_ / name);
  }
  fs::permissions(staging_, fs::status(target_).permissions());
  SyncFolder(staging_);
  sibling_ = Exchange(staging_, target_);
  SyncPlace();
}

}  // namespace krot::internal
