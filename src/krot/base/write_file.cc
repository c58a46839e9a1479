#include "krot/base/write_file.h"

#include <cerrno>
#include <new>
#include <optional>
#include <system_error>
#include <utility>

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

fs::path ParentFolder(const fs::path& file) {
  const fs::path parent = file.parent_path();
  return parent.empty() ? fs::path(".") : parent;
}

// An absolute path with a trailing slash, so that "out/" and "out" compare
// equal.
fs::path Normal(const fs::path& folder) {
  return (fs::absolute(folder) / "").lexically_normal();
}

// The action that failed on a file, and the reason.
struct Failure {
  const char* action;
  std::string reason;
};

Failure FailureOf(const char* action) {
  return {action, std::generic_category().message(errno)};
}

std::optional<Failure> TryToWrite(const fs::path& file,
                                  std::string_view contents) {
  FileDescriptor descriptor(file, FileDescriptor::Use::kReplace);
  if (!descriptor.is_open()) return FailureOf("created");
  if (!descriptor.Write(contents)) return FailureOf("written");
  // Some file systems report only at this point that there is no space left.
  if (!descriptor.Sync()) return FailureOf("written");
  if (!descriptor.Close()) return FailureOf("written");
  return std::nullopt;
}

}  // namespace

void CheckFileWritable(const fs::path& file, const fs::path& folder_to_come) {
  const fs::path folder = ParentFolder(file);
  std::error_code ignored;
  if (!file.has_filename() || fs::is_directory(file, ignored)) {
    throw WriteError(file.string() + " is a folder, expected a file name");
  }
  if (fs::exists(file, ignored) && !fs::is_regular_file(file, ignored)) {
    throw WriteError(file.string() + " exists and is not a regular file");
  }
  if (!folder_to_come.empty() && Normal(folder) == Normal(folder_to_come)) {
    return;
  }
  if (!fs::is_directory(folder, ignored)) {
    throw WriteError(file.string() + " cannot be written: there is no folder " +
                     folder.string());
  }
  if (const std::error_code error = TryToCreateIn(folder)) {
    throw WriteError(file.string() + " cannot be written: folder " +
                     folder.string() + " is not writable: " + error.message());
  }
}

void WriteFile(const fs::path& file, std::string_view contents,
               const fs::path& final_name) {
  if (const std::optional<Failure> failure = TryToWrite(file, contents)) {
    throw WriteError((final_name.empty() ? file : final_name).string() +
                     ": cannot be " + failure->action + ": " + failure->reason);
  }
}

void WriteFileAtomically(const fs::path& file, std::string_view contents) {
  fs::path temporary = file;
  temporary += ".new-" + std::to_string(ProcessId());
  const auto fail = [&](std::string why) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    if (fs::exists(temporary, ignored)) {
      why += "; " + temporary.string() + " is left";
    }
    throw WriteError(file.string() + " cannot be written: " + why);
  };

  if (const std::optional<Failure> failure = TryToWrite(temporary, contents)) {
    fail(failure->reason);
  }
  std::error_code error;
  fs::rename(temporary, file, error);
  if (error) fail(error.message());
  SyncFolder(ParentFolder(file));
}

void SyncFolder(const fs::path& folder) {
  if (const std::error_code error = SyncEntries(folder)) {
    throw WriteError(folder.string() +
                     ": cannot be written: " + error.message());
  }
}

namespace {

// Appends the names in a folder, in no particular order.
std::error_code ListEntries(const fs::path& folder,
                            std::vector<fs::path>* names) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    names->push_back(entry->path().filename());
  }
  return error;
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
  std::error_code error;
  fs::remove(path, error);
  return failure ? failure : error;
} catch (const std::bad_alloc&) {
  return std::make_error_code(std::errc::not_enough_memory);
}

namespace {

// The path that rename acts on: without symbolic links, dots and a trailing
// slash.
fs::path Resolve(const fs::path& target) {
  if (target.empty()) throw WriteError("found no name of an output folder");
  const fs::path resolved = fs::weakly_canonical(fs::absolute(target));
  return resolved.has_filename() ? resolved : resolved.parent_path();
}

// `path`, or its nearest parent that exists.
fs::path ExistingPart(fs::path path) {
  while (!fs::exists(path)) path = path.parent_path();
  return path;
}

bool HoldsWorkingDirectory(const fs::path& folder) {
  std::error_code ignored;
  fs::path current = fs::current_path();
  while (!fs::equivalent(current, folder, ignored)) {
    if (!current.has_relative_path()) return false;
    current = current.parent_path();
  }
  return true;
}

void CheckFolderIsWritable(const fs::path& folder) {
  if (!fs::is_directory(folder)) {
    throw WriteError(folder.string() + ": is a file, expected a folder");
  }
  std::error_code error = CheckPermissions(folder);
  if (!error) error = TryToCreateIn(folder);
  if (error) {
    throw WriteError(folder.string() +
                     ": cannot be written to: " + error.message());
  }
}

// Creates a folder beside `target`, with the permissions that mkdir gives.
fs::path CreateSibling(const fs::path& target) {
  for (int i = 0;; ++i) {
    const std::string name = "." + target.filename().string() + ".krot-" +
                             std::to_string(ProcessId()) + "-" +
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
  std::error_code error = ExchangeNames(staging, target);
  if (!error) return staging;
  if (error != std::errc::function_not_supported) {
    throw WriteError(target.string() +
                     ": cannot be replaced: " + error.message());
  }
  fs::path old = staging;
  old += "-old";
  fs::rename(target, old);
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
    // There is no memory left for the sentence.
  }
}

// The new folder is in place already, so a failure here is only worth a note.
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
    if (!fs::is_directory(to) || from == staging_) {
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
