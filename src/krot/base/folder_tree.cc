#include "krot/base/folder_tree.h"

#include <dirent.h>
#include <stdio.h>

#include <cerrno>
#include <memory>
#include <new>
#include <string_view>

namespace krot {
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

}  // namespace krot
