#pragma once

#include <sqlite3.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace krot::internal {

// Writes databases as COLMAP does, apart from WriteDatabase, and wrong ones.
class DatabaseWriter {
 public:
  using Matches = std::vector<std::array<uint32_t, 2>>;

  // With rigs, frames and pose priors as since COLMAP 3.12, or the tables of
  // COLMAP 3.8.
  explicit DatabaseWriter(const std::filesystem::path& path,
                          bool has_rigs = false) {
    if (sqlite3_open(path.c_str(), &database_) != SQLITE_OK) {
      throw std::runtime_error(path.string() + ": cannot be created");
    }
    const std::string priors =
        has_rigs ? ""
                 : ", prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz "
                   "REAL, prior_tx REAL, prior_ty REAL, prior_tz REAL";
    Execute(
        "PRAGMA journal_mode=WAL;"
        "CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT "
        "NULL, model INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER "
        "NOT NULL, params BLOB, prior_focal_length INTEGER NOT NULL);"
        "CREATE TABLE images (image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT "
        "NULL, name TEXT NOT NULL UNIQUE, camera_id INTEGER NOT NULL" +
        priors +
        ");"
        "CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY NOT NULL, rows "
        "INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);"
        "CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY NOT "
        "NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB, config "
        "INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);");
    if (!has_rigs) return;
    Execute(
        "CREATE TABLE rigs (rig_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, "
        "ref_sensor_id INTEGER NOT NULL, ref_sensor_type INTEGER NOT NULL);"
        "CREATE TABLE frames (frame_id INTEGER PRIMARY KEY AUTOINCREMENT NOT "
        "NULL, rig_id INTEGER NOT NULL);"
        "CREATE TABLE pose_priors (image_id INTEGER PRIMARY KEY NOT NULL, "
        "position BLOB, coordinate_system INTEGER NOT NULL);");
  }
  ~DatabaseWriter() { sqlite3_close(database_); }
  DatabaseWriter(const DatabaseWriter&) = delete;
  DatabaseWriter& operator=(const DatabaseWriter&) = delete;

  void Execute(const std::string& sql) {
    char* error = nullptr;
    if (sqlite3_exec(database_, sql.c_str(), nullptr, nullptr, &error) ==
        SQLITE_OK) {
      return;
    }
    const std::string message = error;
    sqlite3_free(error);
    throw std::runtime_error(message);
  }

  // Keypoints of 2, 4 or 6 columns; what stands behind x and y is 9.
  void AddImage(int64_t id, const std::string& name,
                const std::vector<Eigen::Vector2d>& keypoints,
                int columns = 4) {
    std::vector<float> data;
    for (const Eigen::Vector2d& keypoint : keypoints) {
      data.push_back(static_cast<float>(keypoint.x()));
      data.push_back(static_cast<float>(keypoint.y()));
      data.resize(data.size() + columns - 2, 9);
    }
    Execute("INSERT INTO images (image_id, name, camera_id) VALUES (" +
            std::to_string(id) + ", '" + name + "', 1)");
    Insert("INSERT INTO keypoints VALUES (" + std::to_string(id) + ", " +
               std::to_string(keypoints.size()) + ", " +
               std::to_string(columns) + ", ?)",
           data.data(), data.size() * sizeof(float));
  }

  // As COLMAP: the image with the smaller id first. Requires id1 < id2.
  void AddPair(int64_t id1, int64_t id2, const Matches& matches,
               int config = 2) {
    Insert(
        "INSERT INTO two_view_geometries (pair_id, rows, cols, config, "
        "data) VALUES (" +
            std::to_string(2147483647 * id1 + id2) + ", " +
            std::to_string(matches.size()) + ", 2, " + std::to_string(config) +
            ", ?)",
        matches.data(), matches.size() * sizeof(matches[0]));
  }

 private:
  void Insert(const std::string& sql, const void* data, size_t size) {
    sqlite3_stmt* statement = nullptr;
    sqlite3_prepare_v2(database_, sql.c_str(), -1, &statement, nullptr);
    sqlite3_bind_blob(statement, 1, data, static_cast<int>(size),
                      SQLITE_TRANSIENT);
    const int status = sqlite3_step(statement);
    sqlite3_finalize(statement);
    if (status != SQLITE_DONE) throw std::runtime_error("cannot insert");
  }

  sqlite3* database_ = nullptr;
};

}  // namespace krot::internal
