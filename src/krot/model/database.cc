#include "krot/database.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/model/model_io.h"
#include "krot/model/sqlite_rows.h"

namespace krot {

using namespace internal;

namespace {

// Index in Model::images by the database's image id, for images that both have.
using ImageOfId = std::unordered_map<int64_t, int32_t>;

ImageOfId JoinImages(const Model& model, SqliteDatabase* database) {
  std::unordered_map<std::string_view, int32_t> image_of_name;
  for (size_t i = 0; i < model.images.size(); ++i) {
    const std::string& name = model.images[i].name;
    if (image_of_name.emplace(name, static_cast<int32_t>(i)).second) continue;
    database->Fail("found several images of the model with the name \"" + name +
                   "\", expected different names: images of the database go "
                   "by their names");
  }
  ImageOfId join;
  std::vector<bool> is_taken(model.images.size());
  SqliteRows rows(database, "images", "image_id, name");
  std::string other;  // one that the model does not have
  while (rows.Next()) {
    const int64_t id = rows.Integer(0);
    const std::string name = rows.Text(1);
    if (id < 0 || id >= kMaxNumImages) {
      database->Fail("found image id " + std::to_string(id) +
                     ", expected 0 to " + std::to_string(kMaxNumImages - 1));
    }
    const auto found = image_of_name.find(name);
    if (found == image_of_name.end()) {
      if (other.empty()) other = name;
      continue;
    }
    if (is_taken[found->second] || !join.emplace(id, found->second).second) {
      database->Fail("found image \"" + name +
                     "\" twice, expected unique names");
    }
    is_taken[found->second] = true;
  }
  if (join.empty()) {
    database->Fail(
        "found none of the model's images, such as \"" +
        (model.images.empty() ? std::string() : model.images[0].name) + "\"" +
        (other.empty() ? "" : ", but others, such as \"" + other + "\"") +
        ", expected the database that the model was made from");
  }
  return join;
}

double Correlation(const std::vector<Eigen::Vector2d>& keypoints,
                   const std::vector<Point2D>& points2D, int axis) {
  Eigen::VectorXd a(keypoints.size()), b(keypoints.size());
  for (size_t i = 0; i < keypoints.size(); ++i) {
    a[i] = keypoints[i][axis];
    b[i] = axis == 0 ? points2D[i].x : points2D[i].y;
  }
  a.array() -= a.mean();
  b.array() -= b.mean();
  const double lengths = a.norm() * b.norm();
  // Coordinates that are all the same do not contradict anything.
  return lengths > 0 ? a.dot(b) / lengths : 1;
}

// Whether an image's 2D points are these keypoints one by one, although the
// photo may have been undistorted or resized since. The coordinates of other
// features would not correlate.
bool AreSameFeatures(const std::vector<Eigen::Vector2d>& keypoints,
                     const std::vector<Point2D>& points2D) {
  if (keypoints.size() != points2D.size()) return false;
  bool are_equal = true;
  for (size_t i = 0; i < keypoints.size() && are_equal; ++i) {
    are_equal = keypoints[i] == Eigen::Vector2d(points2D[i].x, points2D[i].y);
  }
  if (are_equal) return true;
  return std::min(Correlation(keypoints, points2D, 0),
                  Correlation(keypoints, points2D, 1)) > 0.9;
}

// Whether at least half of the 2D points that see a 3D point are among the
// keypoints; the model may have dropped some keypoints.
bool AreAmong(const std::vector<Eigen::Vector2d>& keypoints,
              const std::vector<Point2D>& points2D) {
  const auto key = [](double x, double y) {
    return std::hash<double>()(x) * 31 + std::hash<double>()(y);
  };
  std::unordered_set<size_t> known;
  for (const Eigen::Vector2d& x : keypoints) known.insert(key(x.x(), x.y()));
  int64_t found = 0, of = 0;
  for (const Point2D& point : points2D) {
    if (point.point3D_id == kInvalidPoint3DId) continue;
    ++of;
    if (known.count(key(point.x, point.y)) > 0) ++found;
  }
  return 2 * found >= of;
}

// The scale of a keypoint, as COLMAP defines it. A keypoint has 4 columns (x,
// y, scale, orientation) or 6 (x, y and an affine shape); for the latter it is
// the mean of the shape's two scales.
float ScaleOf(const float* keypoint, int64_t columns) {
  if (columns == 4) return keypoint[2];
  return (std::hypot(keypoint[2], keypoint[4]) +
          std::hypot(keypoint[3], keypoint[5])) /
         2;
}

void ReadKeypoints(const Model& model, const ImageOfId& join,
                   SqliteDatabase* database, Database* read) {
  read->keypoints.resize(model.images.size());
  read->scales.resize(model.images.size());
  SqliteRows rows(database, "keypoints", "image_id, rows, cols, data");
  std::vector<float> elements;
  int64_t columns = 0;
  while (rows.Next()) {
    const auto joined = join.find(rows.Integer(0));
    if (joined == join.end()) continue;
    const Image& image = model.images[joined->second];
    const std::string where = "keypoints of image \"" + image.name + "\"";
    const int64_t count = rows.Matrix(1, where, 2, 6, &elements, &columns);
    if (count > 0 && columns % 2 != 0) {
      database->Fail(where + ": found " + std::to_string(columns) +
                     " columns, expected 2, 4 or 6");
    }
    auto& keypoints = read->keypoints[joined->second];
    keypoints.resize(count);
    for (int64_t i = 0; i < count; ++i) {
      keypoints[i] = {elements[i * columns], elements[i * columns + 1]};
      if (keypoints[i].allFinite()) continue;
      database->Fail(where + ": found a coordinate of keypoint " +
                     std::to_string(i) +
                     " that is not finite, expected a finite number");
    }
    if (image.points2D.empty() || keypoints.empty()) continue;
    if (AreSameFeatures(keypoints, image.points2D)) {
      for (int64_t i = 0; i < count; ++i) {
        keypoints[i] = {image.points2D[i].x, image.points2D[i].y};
        if (columns < 4) continue;
        read->scales[joined->second].push_back(
            ScaleOf(&elements[i * columns], columns));
      }
    } else if (!AreAmong(keypoints, image.points2D)) {
      for (const Image& other : model.images) {
        if (!AreSameFeatures(keypoints, other.points2D)) continue;
        database->Fail(where + ": found the 2D points of the model's image \"" +
                       other.name +
                       "\", expected its own; give the model's images the "
                       "names of their photos");
      }
      database->Fail(where + ": found " + std::to_string(count) +
                     " keypoints that are not the model's " +
                     std::to_string(image.points2D.size()) +
                     " 2D points, expected the database that the model was "
                     "made from");
    }
  }
}

void RequireKeypoint(const Database& read, const Model& model, int32_t image,
                     uint32_t keypoint, const SqliteDatabase& database) {
  if (keypoint < read.keypoints[image].size()) return;
  database.Fail("found keypoint " + std::to_string(keypoint) + " of image \"" +
                model.images[image].name +
                "\" in a verified match, but that image has only " +
                std::to_string(read.keypoints[image].size()) + " keypoints");
}

// Merges the matches of a pair that the table lists under both orders of its
// ids.
void AddMatches(VerifiedPair from, VerifiedPair* to) {
  if (from.image1 != to->image1) {
    for (auto& match : from.matches) std::swap(match[0], match[1]);
  }
  auto& matches = to->matches;
  matches.insert(matches.end(), from.matches.begin(), from.matches.end());
  SortUnique(&matches);
}

void ReadPairs(const Model& model, const ImageOfId& join,
               SqliteDatabase* database, Database* read) {
  SqliteRows rows(database, "two_view_geometries",
                  "pair_id, rows, cols, data, config");
  std::map<std::pair<int32_t, int32_t>, size_t> pair_of_images;
  std::vector<uint32_t> elements;
  int64_t columns = 0;
  while (rows.Next()) {
    const int64_t pair_id = rows.Integer(0);
    const int64_t config = rows.Integer(4);
    const int64_t id1 = pair_id / kMaxNumImages, id2 = pair_id % kMaxNumImages;
    // Like COLMAP, accepts pairs with the larger id first; other programs write
    // them.
    if (pair_id < 0 || id1 == id2) {
      database->Fail("found pair id " + std::to_string(pair_id) +
                     ", expected 2147483647 times an image id plus another "
                     "one");
    }
    if (config < 0 || config > 9) {
      database->Fail("found configuration " + std::to_string(config) +
                     " of a two-view geometry, expected 0 to 9");
    }
    const std::string where = "matches of images " + std::to_string(id1) +
                              " and " + std::to_string(id2);
    const int64_t count = rows.Matrix(1, where, 2, 2, &elements, &columns);
    if (count == 0 || config < 2) continue;  // undefined or degenerate
    const auto joined1 = join.find(id1), joined2 = join.find(id2);
    if (joined1 == join.end() || joined2 == join.end()) {
      ++read->num_other_pairs;
      continue;
    }
    if (config == 7) {  // watermark
      ++read->num_watermarks;
      continue;
    }
    VerifiedPair pair;
    pair.image1 = joined1->second;
    pair.image2 = joined2->second;
    pair.config = static_cast<int>(config);
    pair.matches.resize(count);
    for (int64_t i = 0; i < count; ++i) {
      pair.matches[i] = {elements[2 * i], elements[2 * i + 1]};
      RequireKeypoint(*read, model, pair.image1, elements[2 * i], *database);
      RequireKeypoint(*read, model, pair.image2, elements[2 * i + 1],
                      *database);
    }
    const auto [known, is_new] = pair_of_images.emplace(
        std::minmax(pair.image1, pair.image2), read->pairs.size());
    if (is_new) {
      read->pairs.push_back(std::move(pair));
    } else {
      AddMatches(pair, &read->pairs[known->second]);
    }
  }
}

}  // namespace

Database ReadDatabase(const std::filesystem::path& path, const Model& model,
                      const FileNote& note) {
  SqliteDatabase database(path);
  Database read;
  const ImageOfId join = JoinImages(model, &database);
  read.num_images = static_cast<int64_t>(join.size());
  ReadKeypoints(model, join, &database, &read);
  ReadPairs(model, join, &database, &read);
  database.RequireUnchanged();
  const auto num_images = static_cast<int64_t>(model.images.size());
  if (note && read.num_images < num_images) {
    note(path.string() + " has " + std::to_string(read.num_images) +
         " of the model's " + std::to_string(num_images) +
         " images; nothing is said of the others");
  }
  return read;
}

}  // namespace krot
