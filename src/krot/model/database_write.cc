#include <sqlite3.h>

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "krot/base/write_file.h"
#include "krot/database.h"
#include "krot/model/sqlite_rows.h"

namespace krot {

using namespace internal;

namespace {

// The tables as COLMAP 3.8 creates them; later versions add what they need.
constexpr char kTables[] =
    "PRAGMA journal_mode = OFF;"
    "PRAGMA synchronous = OFF;"
    "PRAGMA user_version = 3800;"
    "BEGIN;"
    "CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT "
    "NULL, model INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER NOT "
    "NULL, params BLOB, prior_focal_length INTEGER NOT NULL);"
    "CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, "
    "name TEXT NOT NULL UNIQUE, camera_id INTEGER NOT NULL, prior_qw REAL, "
    "prior_qx REAL, prior_qy REAL, prior_qz REAL, prior_tx REAL, prior_ty "
    "REAL, prior_tz REAL, CONSTRAINT image_id_check CHECK(image_id >= 0 and "
    "image_id < 2147483647), FOREIGN KEY(camera_id) REFERENCES "
    "cameras(camera_id));"
    "CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows "
    "INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, FOREIGN KEY(image_id) "
    "REFERENCES images(image_id) ON DELETE CASCADE);"
    "CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY NOT NULL, rows "
    "INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, FOREIGN KEY(image_id) "
    "REFERENCES images(image_id) ON DELETE CASCADE);"
    "CREATE TABLE matches (pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER "
    "NOT NULL, cols INTEGER NOT NULL, data BLOB);"
    "CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT NULL, "
    "rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, config INTEGER "
    "NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);"
    "CREATE UNIQUE INDEX index_name ON images(name);";

class DatabaseFile {
 public:
  // Errors call the file `name`.
  DatabaseFile(const std::string& path, const std::string& name)
      : name_(name), database_(nullptr, &sqlite3_close_v2) {
    sqlite3* database = nullptr;
    const int status = sqlite3_open(path.c_str(), &database);
    database_.reset(database);
    Require(status == SQLITE_OK);
  }

  void Execute(const char* sql) {
    Require(sqlite3_exec(database_.get(), sql, nullptr, nullptr, nullptr) ==
            SQLITE_OK);
  }

  // Inserts one row: the integers, then a text or a blob, if there is one, in
  // the order of the question marks in `sql`.
  void Insert(const std::string& sql, const std::vector<int64_t>& integers,
              const std::string* text, const void* blob, size_t bytes) {
    sqlite3_stmt* raw = nullptr;
    const int status =
        sqlite3_prepare_v2(database_.get(), sql.c_str(), -1, &raw, nullptr);
    const std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)> statement(
        raw, &sqlite3_finalize);
    Require(status == SQLITE_OK);
    int column = 0;
    for (const int64_t value : integers) {
      Require(sqlite3_bind_int64(raw, ++column, value) == SQLITE_OK);
    }
    if (text != nullptr) {
      Require(sqlite3_bind_text64(raw, ++column, text->data(), text->size(),
                                  SQLITE_STATIC, SQLITE_UTF8) == SQLITE_OK);
    } else {
      // An empty blob, not NULL.
      Require(sqlite3_bind_blob64(raw, ++column, bytes == 0 ? "" : blob, bytes,
                                  SQLITE_STATIC) == SQLITE_OK);
    }
    Require(sqlite3_step(raw) == SQLITE_DONE);
  }

 private:
  void Require(bool holds) const {
    if (holds) return;
    throw WriteError(name_ +
                     ": cannot be written: " + sqlite3_errmsg(database_.get()));
  }

  const std::string name_;
  std::unique_ptr<sqlite3, int (*)(sqlite3*)> database_;
};

void InsertImages(const Model& model, const Database& contents,
                  DatabaseFile* file) {
  for (const Camera& camera : model.cameras) {
    file->Insert(
        "INSERT INTO cameras VALUES (?, ?, ?, ?, ?5, 1)",
        {camera.id, camera.model_id, static_cast<int64_t>(camera.width),
         static_cast<int64_t>(camera.height)},
        nullptr, camera.params.data(), camera.params.size() * sizeof(double));
  }
  for (size_t i = 0; i < model.images.size(); ++i) {
    const Image& image = model.images[i];
    file->Insert(
        "INSERT INTO images (image_id, camera_id, name) VALUES (?, ?, ?)",
        {image.id, image.camera_id}, &image.name, nullptr, 0);
    // x, y, scale, orientation.
    std::vector<float> data;
    for (size_t k = 0; k < contents.keypoints[i].size(); ++k) {
      const Eigen::Vector2d& keypoint = contents.keypoints[i][k];
      const bool has_scale = k < contents.scales[i].size();
      data.insert(data.end(), {static_cast<float>(keypoint.x()),
                               static_cast<float>(keypoint.y()),
                               has_scale ? contents.scales[i][k] : 1.0F, 0.0F});
    }
    const auto rows = static_cast<int64_t>(contents.keypoints[i].size());
    file->Insert("INSERT INTO keypoints VALUES (?, ?, 4, ?)", {image.id, rows},
                 nullptr, data.data(), data.size() * sizeof(float));
    file->Insert("INSERT INTO descriptors VALUES (?, 0, 128, ?)", {image.id},
                 nullptr, nullptr, 0);
  }
}

void InsertPairs(const Model& model, const Database& contents,
                 DatabaseFile* file) {
  for (const VerifiedPair& pair : contents.pairs) {
    int64_t id1 = model.images[pair.image1].id;
    int64_t id2 = model.images[pair.image2].id;
    std::vector<std::array<uint32_t, 2>> matches = pair.matches;
    if (id1 > id2) {
      std::swap(id1, id2);
      for (auto& match : matches) std::swap(match[0], match[1]);
    }
    const int64_t pair_id = kMaxNumImages * id1 + id2;
    const auto rows = static_cast<int64_t>(matches.size());
    const size_t bytes = matches.size() * sizeof(matches[0]);
    file->Insert("INSERT INTO matches VALUES (?, ?, 2, ?)", {pair_id, rows},
                 nullptr, matches.data(), bytes);
    file->Insert(
        "INSERT INTO two_view_geometries (pair_id, rows, cols, config, data) "
        "VALUES (?, ?, 2, ?, ?)",
        {pair_id, rows, pair.config}, nullptr, matches.data(), bytes);
  }
}

}  // namespace

void WriteDatabase(const std::filesystem::path& path, const Model& model,
                   const Database& contents) {
  CheckFileWritable(path);
  const std::filesystem::path part = path.string() + ".part";
  std::error_code error;
  std::filesystem::remove(part, error);
  try {
    DatabaseFile file(part.string(), path.string());
    file.Execute(kTables);
    InsertImages(model, contents, &file);
    InsertPairs(model, contents, &file);
    file.Execute("COMMIT");
  } catch (...) {
    std::filesystem::remove(part, error);
    throw;
  }
  std::filesystem::rename(part, path, error);
  if (error) {
    throw WriteError(path.string() + ": cannot be written: " + error.message());
  }
}

}  // namespace krot
