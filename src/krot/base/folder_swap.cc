#include "krot/base/folder_swap.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <new>
#include <string>
#include <system_error>
#include <utility>

#include "krot/base/folder_tree.h"
#include "krot/base/write_file.h"

namespace krot {
namespace {

namespace fs = std::filesystem;

// Without symbolic links, dots and a trailing slash: what rename acts on.
fs::path Resolve(const fs::path& target) {
  if (target.empty()) throw WriteError("found no name of an output folder");
  const fs::path resolved = fs::weakly_canonical(fs::absolute(target));
  return resolved.has_filename() ? resolved : resolved.parent_path();
}

std::string Reason(int error) { return std::generic_category().message(error); }

// False where the system does not tell.
bool IsMountPoint([[maybe_unused]] const fs::path& folder) {
#ifdef STATX_ATTR_MOUNT_ROOT
  struct statx status;
  return ::statx(AT_FDCWD, folder.c_str(), 0, 0, &status) == 0 &&
         (status.stx_attributes & STATX_ATTR_MOUNT_ROOT) != 0;
#else
  return false;
#endif
}

// Exchanges two names in one step; false, with errno, where that is not to be
// had.
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

// Puts `from` into place as `to`: the same file by a hard link, a copy where
// the file system has none, a folder entry by entry.
void Carry(const fs::path& from, const fs::path& to) {
  const fs::file_status status = fs::symlink_status(from);
  if (fs::is_directory(status)) {
    // Removing the old folder would empty what is mounted there.
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

// Exchanges two folders; returns where the old one is now. File systems without
// RENAME_EXCHANGE need two renames; between them the old folder bears a name of
// its own, which it keeps.
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
    // Nothing is left to say it with.
  }
}

// The new folder is in place: what fails now is only worth a note.
void FolderSwap::SyncPlace() const {
  try {
    SyncFolder(target_.parent_path());
  } catch (const WriteError& error) {
    if (note_) note_(error.what());
  }
}

// Of a target that did not exist. Where others have made some of its parents
// meanwhile, what those still lack.
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

}  // namespace krot
