#include "krot/report/pair_view.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "krot/analysis/epipolar_match.h"
#include "krot/model/image_geometry.h"

namespace krot::internal {
namespace {

// Of a pair that agrees, and of any other.
constexpr size_t kMatchesOfKept = 30;
constexpr size_t kMatchesOfOthers = 100;

class PairView {
 public:
  PairView(const Model& model, const Database& database, const PairCheck& check)
      : model_(model),
        database_(database),
        check_(check),
        geometries_(ImageGeometries(model)) {
    for (const ImageGeometry& geometry : geometries_) {
      const Camera& camera = model.cameras[geometry.camera];
      scales_.push_back(kPairViewSide / static_cast<double>(std::max<uint64_t>(
                                            {1, camera.width, camera.height})));
    }
  }

  Json Run() const {
    Json images = Json::array();
    for (size_t i = 0; i < model_.images.size(); ++i) {
      const Camera& camera = model_.cameras[geometries_[i].camera];
      const auto side = [&](uint64_t pixels) {
        return std::lround(scales_[i] * static_cast<double>(pixels));
      };
      images.push_back({{"width", side(camera.width)},
                        {"height", side(camera.height)},
                        {"jpeg", nullptr}});
    }
    Json pairs = Json::array();
    for (size_t p = 0; p < check_.pairs.size(); ++p) {
      pairs.push_back(MatchesOf(database_.pairs[p], check_.pairs[p]));
    }
    return {{"images", images}, {"matches", pairs}};
  }

 private:
  bool Agrees(const VerifiedPair& pair, const std::array<uint32_t, 2>& match,
              const Eigen::Vector3d& baseline) const {
    std::vector<PixelRay> rays;
    for (const int side : {0, 1}) {
      const int32_t image = side == 0 ? pair.image1 : pair.image2;
      const auto ray = RayOf(model_.cameras[geometries_[image].camera],
                             database_.keypoints[image][match[side]]);
      if (!ray) return false;
      const Eigen::Matrix3d world_from_cam =
          geometries_[image].cam_from_world.rotation.transpose();
      rays.push_back(world_from_cam * *ray);
    }
    return EpipolarMatch(rays[0], rays[1]).ErrorPx(baseline) <=
           check_.tolerance_px;
  }

  Json MatchesOf(const VerifiedPair& pair, const CheckedPair& checked) const {
    const size_t most =
        checked.state == PairState::kKept ? kMatchesOfKept : kMatchesOfOthers;
    const size_t shown = std::min(most, pair.matches.size());
    const bool is_checked = checked.state != PairState::kNotChecked;
    const Eigen::Vector3d baseline =
        is_checked ? Center(geometries_[pair.image2].cam_from_world) -
                         Center(geometries_[pair.image1].cam_from_world)
                   : Eigen::Vector3d(Eigen::Vector3d::Zero());
    Json matches = Json::array();
    for (size_t n = 0; n < shown; ++n) {
      const auto& match = pair.matches[n * pair.matches.size() / shown];
      Json entry = Json::array();
      for (const int side : {0, 1}) {
        const int32_t image = side == 0 ? pair.image1 : pair.image2;
        const Eigen::Vector2d& pixel = database_.keypoints[image][match[side]];
        entry.push_back(std::lround(scales_[image] * pixel.x()));
        entry.push_back(std::lround(scales_[image] * pixel.y()));
      }
      entry.push_back(is_checked && Agrees(pair, match, baseline) ? 1 : 0);
      matches.push_back(entry);
    }
    return matches;
  }

  const Model& model_;
  const Database& database_;
  const PairCheck& check_;
  const std::vector<ImageGeometry> geometries_;
  std::vector<double> scales_;  // of images
};

}  // namespace

Json PairViewJson(const Model& model, const Database& database,
                  const PairCheck& check) {
  return PairView(model, database, check).Run();
}

}  // namespace krot::internal
