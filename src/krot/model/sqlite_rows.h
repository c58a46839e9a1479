#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

struct sqlite3;
struct sqlite3_stmt;

namespace krot::internal {

// An SQLite database that is read in one consistent state and never written to.
// Everything that is wrong with it throws ModelError with a sentence that
// begins with its path.
class SqliteDatabase {
 public:
  explicit SqliteDatabase(const std::filesystem::path& path);

  // Throws if the file was read without locks and has been written to since.
  void RequireUnchanged() const;

  [[noreturn]] void Fail(const std::string& what) const;

 private:
  friend class SqliteRows;

  // Changes if the file is written to.
  struct FileState {
    bool exists = false;
    int64_t size = 0;
    std::filesystem::file_time_type written = {};
    bool operator==(const FileState& other) const {
      return exists == other.exists && size == other.size &&
             written == other.written;
    }
  };
  static FileState StateOf(const std::string& path);
  // The states of the file, its write-ahead log and its journal.
  std::array<FileState, 3> States() const;

  // Subtracts what was read from the size of the file, and throws if it is
  // exceeded: a damaged file may claim to hold more than it can.
  void Account(int64_t bytes);

  // Throws ModelError unless SQLite's status is one of success, and
  // std::bad_alloc if memory is short. SQLite also reports some damage as a
  // lack of memory: if it does so a second time while memory is available, that
  // counts as damage.
  void Require(int status) const;

  const std::string name_;
  std::string path_;
  bool is_unlocked_ = false;
  std::array<FileState, 3> before_;
  std::unique_ptr<sqlite3, int (*)(sqlite3*)> database_;
  int64_t bytes_left_ = 0;
};

// COLMAP's pair id is this times the smaller image id plus the larger one.
inline constexpr int64_t kMaxNumImages = 2147483647;

// The rows of a table, one after another. Throws ModelError for values of
// another type than asked for.
class SqliteRows {
 public:
  // `columns` of the table, separated by commas. Throws ModelError if there is
  // no such table or column. Keeps a reference to the database.
  SqliteRows(SqliteDatabase* database, const std::string& table,
             const std::string& columns);

  bool Next();

  int64_t Integer(int column) const;
  double Real(int column) const;  // integers are converted; NaN for NULL
  std::string Text(int column) const;
  std::string_view Blob(int column) const;  // valid until Next; empty for NULL

  // Reads one of COLMAP's matrix blobs, row by row: `rows_column` and the two
  // columns behind it hold its number of rows, its number of columns and its
  // data. Returns the number of rows. Throws ModelError, about `where`, if the
  // three do not agree.
  template <typename T>
  int64_t Matrix(int rows_column, const std::string& where, int64_t min_columns,
                 int64_t max_columns, std::vector<T>* elements,
                 int64_t* num_columns) const {
    *num_columns = Integer(rows_column + 1);
    const int64_t rows =
        CheckedRows(rows_column, where, min_columns, max_columns, sizeof(T));
    elements->resize(rows * *num_columns);
    const std::string_view blob = Blob(rows_column + 2);
    if (rows > 0) std::memcpy(elements->data(), blob.data(), blob.size());
    return rows;
  }

 private:
  void Prepare(const std::string& sql);
  int Type(int column) const;
  [[noreturn]] void FailType(int column, const std::string& type) const;
  int64_t CheckedRows(int rows_column, const std::string& where,
                      int64_t min_columns, int64_t max_columns,
                      int64_t element_bytes) const;

  SqliteDatabase& database_;
  const std::string table_;
  int64_t num_rows_ = 0;  // so far
  std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)> statement_;
};

}  // namespace krot::internal
