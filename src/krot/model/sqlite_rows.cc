#include "krot/model/sqlite_rows.h"

#include <sqlite3.h>

#include <algorithm>
#include <cerrno>
#include <new>
#include <system_error>

#include "krot/base/numbers.h"
#include "krot/base/system.h"
#include "krot/model.h"

namespace krot::internal {
namespace {

// The first bytes of the file, which tell its kind.
std::string HeadOf(const std::filesystem::path& path) {
  const FileDescriptor file(path, FileDescriptor::Use::kRead);
  std::string head;
  if (!file.is_open() || !file.ReadAt(0, 64, &head)) {
    throw ModelError(path.string() + ": cannot be opened: " +
                     std::generic_category().message(errno));
  }
  return head;
}

void RequireSqlite(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::exists(path, ignored) &&
      !std::filesystem::is_regular_file(path, ignored)) {
    throw ModelError(path.string() +
                     ": is no regular file, expected COLMAP's database");
  }
  const std::string head = HeadOf(path);
  if (head.rfind("version https://git-lfs", 0) == 0) {
    throw ModelError(path.string() +
                     ": is a Git LFS pointer, not a database; run git lfs pull "
                     "where it was cloned");
  }
  if (head.compare(0, 16, "SQLite format 3", 16) != 0) {  // with its zero byte
    throw ModelError(path.string() +
                     ": is no SQLite database, expected COLMAP's, which is "
                     "mostly called database.db");
  }
}

// The path as a URI, in which no character has a special meaning.
std::string UriOf(const std::string& path) {
  std::string uri = "file:";
  for (const char c : path) {
    switch (c) {
      case '%':
        uri += "%25";
        break;
      case '?':
        uri += "%3f";
        break;
      case '#':
        uri += "%23";
        break;
      default:
        uri += c;
    }
  }
  return uri;
}

// A virtual file system of SQLite, for Unix or Windows, that takes no locks; ""
// if this SQLite has none.
std::string VfsWithoutLocks() {
  for (const char* name : {"unix-none", "win32-none"}) {
    if (sqlite3_vfs_find(name) != nullptr) return name;
  }
  return "";
}

// Calls again what memory was short for, as SQLite says of some damage, too
// (SqliteDatabase::Require).
template <typename Call>
int CallTwice(const Call& call) {
  const int status = call();
  return status == SQLITE_NOMEM ? call() : status;
}

}  // namespace

SqliteDatabase::SqliteDatabase(const std::filesystem::path& path)
    : name_(path.string()), database_(nullptr, &sqlite3_close_v2) {
  RequireSqlite(path);
  // Follows symbolic links, because SQLite looks for the log beside the real
  // file.
  std::error_code error;
  path_ = std::filesystem::canonical(path, error).generic_string();
  if (error == std::errc::not_enough_memory) throw std::bad_alloc();
  if (error) Fail("cannot be opened: " + error.message());
  before_ = States();
  // Nobody is writing if there is no journal, and no log or no index of the
  // log. Then no locks are needed, and SQLite need not create files beside the
  // database. A log without an index was left by a program that crashed.
  const bool has_log = before_[1].size > 0;
  const std::string without_locks = VfsWithoutLocks();
  is_unlocked_ =
      !before_[2].exists &&
      (!has_log || (!without_locks.empty() &&
                    !std::filesystem::exists(path_ + "-shm", error)));
  std::string uri = UriOf(path_) + "?mode=ro";
  if (is_unlocked_) uri += has_log ? "&vfs=" + without_locks : "&immutable=1";
  Require(CallTwice([&] {
    sqlite3* opened = nullptr;
    const int status = sqlite3_open_v2(
        uri.c_str(), &opened, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
    database_.reset(opened);
    return status;
  }));
  sqlite3* const database = database_.get();
  const auto execute = [&](const char* sql) {
    Require(CallTwice([&] {
      return sqlite3_exec(database, sql, nullptr, nullptr, nullptr);
    }));
  };
  sqlite3_busy_timeout(database, 5000);  // milliseconds
  sqlite3_db_config(database, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  sqlite3_db_config(database, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  if (is_unlocked_) {  // keeps the index of the log in memory
    execute("PRAGMA locking_mode = EXCLUSIVE");
  }
  // Everything that follows reads the same state of the database.
  execute("BEGIN");
  for (const FileState& file : before_) bytes_left_ += file.size;
}

SqliteDatabase::FileState SqliteDatabase::StateOf(const std::string& path) {
  FileState state;
  std::error_code error;
  state.size = static_cast<int64_t>(std::filesystem::file_size(path, error));
  state.exists = !error;
  if (!state.exists) state.size = 0;
  state.written = std::filesystem::last_write_time(path, error);
  return state;
}

std::array<SqliteDatabase::FileState, 3> SqliteDatabase::States() const {
  return {StateOf(path_), StateOf(path_ + "-wal"), StateOf(path_ + "-journal")};
}

void SqliteDatabase::RequireUnchanged() const {
  if (!is_unlocked_ || States() == before_) return;
  Fail("was changed while it was read; wait until COLMAP has ended");
}

void SqliteDatabase::Fail(const std::string& what) const {
  throw ModelError(name_ + ": " + what);
}

void SqliteDatabase::Account(int64_t bytes) {
  bytes_left_ -= std::max<int64_t>(bytes, 1);
  if (bytes_left_ >= 0) return;
  Fail(
      "found more data than a file of its size can hold: it is damaged; copy "
      "it anew");
}

void SqliteDatabase::Require(int status) const {
  if (status == SQLITE_OK || status == SQLITE_ROW || status == SQLITE_DONE) {
    return;
  }
  std::string reason =
      database_ ? sqlite3_errmsg(database_.get()) : sqlite3_errstr(status);
  // SQLite reports some damage as a lack of memory, too. If there is memory
  // for far more than a row, it is damage.
  if ((status & 0xff) == SQLITE_NOMEM) {
    void* const memory = sqlite3_malloc(1 << 20);  // bytes
    if (memory == nullptr) throw std::bad_alloc();
    sqlite3_free(memory);
    reason = "its tables make no sense";
  }
  // Without locks, half of what was read may be of one state and half of the
  // next.
  RequireUnchanged();
  if (status == SQLITE_BUSY || status == SQLITE_LOCKED) {
    Fail("is locked by another program; wait until COLMAP has ended");
  }
  if (status == SQLITE_CANTOPEN || (status & 0xff) == SQLITE_READONLY) {
    Fail("cannot be opened for reading alone (" + reason +
         "): the program that wrote it did not end well; copy it, with its "
         "-wal or -journal, into a folder that can be written to and open it "
         "there with COLMAP once");
  }
  Fail("cannot be read (" + reason + "): it is damaged; copy it anew");
}

SqliteRows::SqliteRows(SqliteDatabase* database, const std::string& table,
                       const std::string& columns)
    : database_(*database),
      table_(table),
      statement_(nullptr, &sqlite3_finalize) {
  const auto has_table = [&](const std::string& name) {
    Prepare("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = '" +
            name + "'");
    return Next();
  };
  if (!has_table(table)) {
    if (table == "two_view_geometries" && has_table("inlier_matches")) {
      database_.Fail(
          "found the matches of COLMAP's first versions, expected the table "
          "two_view_geometries; colmap database_creator converts a copy");
    }
    database_.Fail("found no table " + table +
                   ", expected COLMAP's tables images, keypoints and "
                   "two_view_geometries; is this COLMAP's database?");
  }
  Prepare("SELECT " + columns + " FROM " + table);
}

void SqliteRows::Prepare(const std::string& sql) {
  sqlite3_stmt* statement = nullptr;
  sqlite3* database = database_.database_.get();
  const int status = CallTwice([&] {
    return sqlite3_prepare_v2(database, sql.c_str(), -1, &statement, nullptr);
  });
  if (status == SQLITE_ERROR) {
    database_.Fail("the table " + table_ + " is not COLMAP's (" +
                   sqlite3_errmsg(database) +
                   "), expected one of COLMAP 3.8 to 4.x");
  }
  database_.Require(status);
  statement_.reset(statement);
  num_rows_ = 0;
}

bool SqliteRows::Next() {
  int status = sqlite3_step(statement_.get());
  if (status == SQLITE_NOMEM) {  // try once more, from the first row
    sqlite3_reset(statement_.get());
    int64_t row = 0;
    do {
      status = sqlite3_step(statement_.get());
    } while (status == SQLITE_ROW && row++ < num_rows_);
  }
  database_.Require(status);
  if (status != SQLITE_ROW) return false;
  ++num_rows_;
  int64_t bytes = 0;
  for (int i = 0; i < sqlite3_column_count(statement_.get()); ++i) {
    if (Type(i) == SQLITE_BLOB || Type(i) == SQLITE_TEXT) {
      bytes += sqlite3_column_bytes(statement_.get(), i);
    }
  }
  database_.Account(bytes);
  return true;
}

int SqliteRows::Type(int column) const {
  return sqlite3_column_type(statement_.get(), column);
}

void SqliteRows::FailType(int column, const std::string& type) const {
  database_.Fail("table " + table_ + ": found no " + type + " in column " +
                 sqlite3_column_name(statement_.get(), column) +
                 ", expected one there");
}

int64_t SqliteRows::Integer(int column) const {
  if (Type(column) != SQLITE_INTEGER) FailType(column, "integer");
  return sqlite3_column_int64(statement_.get(), column);
}

double SqliteRows::Real(int column) const {
  if (Type(column) == SQLITE_NULL) return kNaN;
  if (Type(column) != SQLITE_INTEGER && Type(column) != SQLITE_FLOAT) {
    FailType(column, "number");
  }
  return sqlite3_column_double(statement_.get(), column);
}

std::string SqliteRows::Text(int column) const {
  if (Type(column) != SQLITE_TEXT) FailType(column, "text");
  const auto* text = sqlite3_column_text(statement_.get(), column);
  if (text == nullptr) throw std::bad_alloc();
  return {reinterpret_cast<const char*>(text),
          static_cast<size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

std::string_view SqliteRows::Blob(int column) const {
  if (Type(column) == SQLITE_NULL) return {};
  if (Type(column) != SQLITE_BLOB) FailType(column, "blob");
  const void* bytes = sqlite3_column_blob(statement_.get(), column);
  if (bytes == nullptr) {  // no bytes, or no memory for them
    if (sqlite3_errcode(database_.database_.get()) == SQLITE_NOMEM) {
      throw std::bad_alloc();
    }
    return {};
  }
  return {static_cast<const char*>(bytes),
          static_cast<size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

int64_t SqliteRows::CheckedRows(int rows_column, const std::string& where,
                                int64_t min_columns, int64_t max_columns,
                                int64_t element_bytes) const {
  const int64_t rows = Integer(rows_column);
  const int64_t columns = Integer(rows_column + 1);
  const auto num_bytes = static_cast<int64_t>(Blob(rows_column + 2).size());
  if (rows == 0 && num_bytes == 0) return 0;
  if (columns < min_columns || columns > max_columns) {
    const std::string up_to =
        min_columns == max_columns ? "" : " to " + std::to_string(max_columns);
    database_.Fail(where + ": found " + std::to_string(columns) +
                   " columns, expected " + std::to_string(min_columns) + up_to);
  }
  const int64_t row_bytes = columns * element_bytes;
  if (rows < 0 || rows > num_bytes / row_bytes ||
      rows * row_bytes != num_bytes) {
    database_.Fail(where + ": found " + std::to_string(num_bytes) +
                   " bytes, expected " + std::to_string(rows) + " rows of " +
                   std::to_string(row_bytes));
  }
  return rows;
}

}  // namespace krot::internal
