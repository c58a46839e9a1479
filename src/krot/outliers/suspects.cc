#include "krot/outliers/suspects.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "krot/model/image_geometry.h"

namespace krot::internal {
namespace {

// Counts per thing, by id.
class Counts {
 public:
  void Add(uint64_t id, bool is_removed, int64_t conflict) {
    Suspect& suspect = suspects_[id];
    suspect.id = id;
    ++suspect.num_observations;
    suspect.num_removed += is_removed;
    if (conflict >= 0) conflicts_[id].insert(conflict);
  }

  std::vector<Suspect> Ranked() {
    std::vector<Suspect> ranked;
    for (auto& [id, suspect] : suspects_) {
      suspect.num_conflicts = static_cast<int64_t>(conflicts_[id].size());
      if (suspect.num_removed > 0) ranked.push_back(std::move(suspect));
    }
    std::stable_sort(ranked.begin(), ranked.end(),
                     [](const Suspect& a, const Suspect& b) {
                       return std::make_pair(a.num_removed, a.num_conflicts) >
                              std::make_pair(b.num_removed, b.num_conflicts);
                     });
    return ranked;
  }

 private:
  std::map<uint64_t, Suspect> suspects_;
  std::map<uint64_t, std::set<int64_t>> conflicts_;
};

}  // namespace

void RankSuspects(const Model& model, const std::vector<char>& is_removed,
                  const std::vector<int64_t>& conflict_of,
                  OutlierFilterSummary* summary) {
  const auto image_of = ImageIndices(model);
  Counts tracks, images, cameras;
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const Image& image =
          model.images[image_of.at(model.track_elements[e].image_id)];
      const bool is_gone = is_removed[e] != 0;
      tracks.Add(point.id, is_gone, conflict_of[e]);
      images.Add(image.id, is_gone, conflict_of[e]);
      cameras.Add(image.camera_id, is_gone, conflict_of[e]);
    }
  }
  summary->tracks = tracks.Ranked();
  summary->images = images.Ranked();
  summary->cameras = cameras.Ranked();
  for (Suspect& suspect : summary->images) {
    suspect.name =
        model.images[image_of.at(static_cast<ImageId>(suspect.id))].name;
  }
}

}  // namespace krot::internal
