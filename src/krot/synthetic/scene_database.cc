#include "krot/synthetic/scene_database.h"

#include <array>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

namespace krot::internal {

Database DatabaseOf(const Model& model) {
  Database database;
  database.num_images = static_cast<int64_t>(model.images.size());
  std::map<Point3DId, std::vector<std::array<uint32_t, 2>>> seen;
  for (uint32_t i = 0; i < model.images.size(); ++i) {
    database.keypoints.emplace_back();
    database.scales.emplace_back(model.images[i].points2D.size(), 1.0F);
    const auto& points2D = model.images[i].points2D;
    for (uint32_t k = 0; k < points2D.size(); ++k) {
      database.keypoints[i].emplace_back(points2D[k].x, points2D[k].y);
      if (points2D[k].point3D_id == kInvalidPoint3DId) continue;
      seen[points2D[k].point3D_id].push_back({i, k});
    }
  }
  std::map<std::pair<int32_t, int32_t>, VerifiedPair> pairs;
  for (const auto& [id, track] : seen) {
    for (const auto& a : track) {
      for (const auto& b : track) {
        if (a[0] >= b[0]) continue;
        VerifiedPair& pair = pairs[{a[0], b[0]}];
        pair.image1 = static_cast<int32_t>(a[0]);
        pair.image2 = static_cast<int32_t>(b[0]);
        pair.config = 2;
        pair.matches.push_back({a[1], b[1]});
      }
    }
  }
  for (const auto& [images, pair] : pairs) database.pairs.push_back(pair);
  return database;
}

}  // namespace krot::internal
