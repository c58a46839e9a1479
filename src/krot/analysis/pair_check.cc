#include "krot/database.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "krot/analysis/epipolar.h"
#include "krot/base/disjoint_sets.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/model/rigs.h"

namespace krot {

using namespace internal;

namespace {

// COLMAP's mapper uses no pair with fewer (Mapper.min_num_matches).
constexpr int64_t kMinMatches = 15;
constexpr int64_t kMinDecidedPairs = 3;  // of an image that is called wrong
class PairChecker {
 public:
  PairChecker(const Model& model, const Database& database,
              const Context& context)
      : model_(model),
        database_(database),
        context_(context),
        geometries_(ImageGeometries(model)),
        errors_px_(database.pairs.size()) {
    check_.pairs.resize(database.pairs.size());
    for (const Image& image : model.images) {
      CheckedImage& checked = check_.images.emplace_back();
      checked.image_id = image.id;
      checked.name = image.name;
    }
  }

  PairCheck Run() {
    Measure();
    const MatchNoise noise = EstimateMatchNoise(errors_px_);
    check_.noise_px = noise.sigma_px;
    check_.tolerance_px = noise.tolerance_px;
    CountPairs();
    SearchBaselines();
    Explain();
    return std::move(check_);
  }

 private:
  PixelRay WorldRay(const PixelRay& ray, int32_t image) const {
    const Eigen::Matrix3d world_from_cam =
        geometries_[image].cam_from_world.rotation.transpose();
    return world_from_cam * ray;
  }

  // Calls visit(ray1, ray2), in camera axes, for each match of a pair whose
  // pixels have rays.
  template <typename Visit>
  void ForEachMatch(const VerifiedPair& pair, const Visit& visit) const {
    const Camera& camera1 = model_.cameras[geometries_[pair.image1].camera];
    const Camera& camera2 = model_.cameras[geometries_[pair.image2].camera];
    for (const auto& [keypoint1, keypoint2] : pair.matches) {
      const auto ray1 =
          RayOf(camera1, database_.keypoints[pair.image1][keypoint1]);
      const auto ray2 =
          RayOf(camera2, database_.keypoints[pair.image2][keypoint2]);
      if (ray1 && ray2) visit(*ray1, *ray2);
    }
  }

  std::vector<EpipolarMatch> MatchesOf(const VerifiedPair& pair) const {
    std::vector<EpipolarMatch> matches;
    matches.reserve(pair.matches.size());
    ForEachMatch(pair, [&](const PixelRay& ray1, const PixelRay& ray2) {
      matches.emplace_back(WorldRay(ray1, pair.image1),
                           WorldRay(ray2, pair.image2));
    });
    return matches;
  }

  // The errors of each pair under the model's poses, ascending; none where
  // there is no baseline.
  void Measure() {
    std::vector<int64_t> num_without_ray(database_.pairs.size(), 0);
    ForEachPair([&](int64_t p) {
      const VerifiedPair& pair = database_.pairs[p];
      CheckedPair& checked = check_.pairs[p];
      checked.image1 = pair.image1;
      checked.image2 = pair.image2;
      checked.median_error_px = std::numeric_limits<double>::quiet_NaN();
      const ImageGeometry& first = geometries_[pair.image1];
      const ImageGeometry& second = geometries_[pair.image2];
      if (!first.has_pose || !second.has_pose) return;
      const std::vector<EpipolarMatch> matches = MatchesOf(pair);
      checked.num_matches = static_cast<int64_t>(matches.size());
      num_without_ray[p] =
          static_cast<int64_t>(pair.matches.size() - matches.size());
      const Eigen::Vector3d center1 = Center(first.cam_from_world);
      const Eigen::Vector3d center2 = Center(second.cam_from_world);
      constexpr double kSamePlace = 1e-12;  // of the coordinates: rounding
      if (checked.num_matches < kMinMatches ||
          (center2 - center1).norm() <=
              kSamePlace * (center1.norm() + center2.norm())) {
        return;
      }
      const Eigen::Vector3d baseline = (center2 - center1).normalized();
      std::vector<double>& errors = errors_px_[p];
      for (const EpipolarMatch& match : matches) {
        errors.push_back(match.ErrorPx(baseline));
      }
      std::sort(errors.begin(), errors.end());
      checked.median_error_px = errors[errors.size() / 2];
      checked.state = PairState::kUndecided;
    });
    for (const int64_t count : num_without_ray) check_.num_without_ray += count;
  }

  void CountPairs() {
    for (size_t p = 0; p < check_.pairs.size(); ++p) {
      CheckedPair& pair = check_.pairs[p];
      if (pair.state == PairState::kNotChecked) {
        ++check_.num_not_checked;
        continue;
      }
      const std::vector<double>& errors = errors_px_[p];
      pair.num_agreeing =
          std::upper_bound(errors.begin(), errors.end(), check_.tolerance_px) -
          errors.begin();
      for (const int32_t i : {pair.image1, pair.image2}) {
        CheckedImage& image = check_.images[i];
        if (2 * pair.num_agreeing >= pair.num_matches) {
          pair.state = PairState::kKept;
          ++image.num_kept;
          image.kept_matches += pair.num_matches;
        } else if (4 * pair.num_agreeing < pair.num_matches) {
          pair.state = PairState::kContradictory;
          ++image.num_contradictory;
          image.contradictory_matches += pair.num_matches;
        } else {
          ++image.num_undecided;
        }
      }
      if (pair.state == PairState::kKept) ++check_.num_kept;
      if (pair.state == PairState::kContradictory) ++check_.num_contradictory;
      if (pair.state == PairState::kUndecided) ++check_.num_undecided;
    }
  }

  void SearchBaselines() {
    ForEachPair([&](int64_t p) {
      CheckedPair& pair = check_.pairs[p];
      if (pair.state != PairState::kContradictory) return;
      BaselineSearch search =
          SearchBaseline(MatchesOf(database_.pairs[p]), check_.tolerance_px);
      pair.num_explained = search.num_explained;
      pair.most_explained = search.upper_bound;
      pair.best_baseline = search.baseline;
      pair.cells = std::move(search.cells);
    });
  }

  void Explain() {
    std::vector<int64_t> costs;
    for (const CheckedImage& image : check_.images) {
      costs.push_back(image.kept_matches);
    }
    std::vector<ContradictoryPair> contradictions;
    for (const CheckedPair& pair : check_.pairs) {
      if (pair.state != PairState::kContradictory) continue;
      contradictions.push_back({pair.image1, pair.image2, pair.num_matches});
    }
    Explanations explanations = ExplainContradictions(costs, contradictions);
    check_.cheapest = std::move(explanations.cheapest);
    check_.is_cheapest_proved = explanations.is_proved;
    check_.runner_up = std::move(explanations.runner_up);
    FindGroups();
    for (const int32_t i : check_.cheapest.images) {
      CheckedImage& image = check_.images[i];
      image.is_wrong =
          image.num_kept + image.num_contradictory >= kMinDecidedPairs;
    }
    ParallelFor(static_cast<int64_t>(check_.images.size()), 1,
                context_.num_threads,
                [&](int64_t begin, int64_t end, int /*worker*/) {
                  for (int64_t i = begin; i < end; ++i) {
                    if (check_.images[i].is_wrong) JudgeImage(i);
                  }
                });
  }

  // What contradicts the poses between right images: groups of them, or their
  // matches.
  void FindGroups() {
    const auto num_images = static_cast<int32_t>(check_.images.size());
    DisjointSets joined(num_images);
    for (const CheckedPair& pair : check_.pairs) {
      if (pair.state == PairState::kKept && AreRight(pair)) {
        joined.Unite(pair.image1, pair.image2);
      }
    }
    std::vector<std::vector<int32_t>> groups(num_images);
    for (int32_t i = 0; i < num_images; ++i) {
      groups[joined.Find(i)].push_back(i);
    }
    std::vector<char> is_contradicted(num_images, 0);
    for (CheckedPair& pair : check_.pairs) {
      if (pair.state != PairState::kContradictory || !AreRight(pair)) continue;
      const int64_t a = joined.Find(pair.image1);
      const int64_t b = joined.Find(pair.image2);
      if (a == b || groups[a].size() < 2 || groups[b].size() < 2) {
        pair.has_wrong_matches = true;
      } else {
        is_contradicted[a] = is_contradicted[b] = 1;
      }
    }
    for (int32_t i = 0; i < num_images; ++i) {
      if (is_contradicted[i]) check_.groups.push_back(groups[i]);
    }
    std::stable_sort(
        check_.groups.begin(), check_.groups.end(),
        [](const auto& a, const auto& b) { return a.size() > b.size(); });
  }

  bool AreRight(const CheckedPair& pair) const {
    return !IsCalledWrong(pair.image1) && !IsCalledWrong(pair.image2);
  }

  bool IsCalledWrong(int32_t image) const {
    return std::binary_search(check_.cheapest.images.begin(),
                              check_.cheapest.images.end(), image);
  }

  // From its pairs with images that are right: the others have two faults.
  void JudgeImage(int64_t i) {
    CheckedImage& image = check_.images[i];
    std::vector<WitnessMatch> matches;
    int64_t most_explained = 0, contradictory = 0;
    NearestPoint to_baselines;
    for (size_t p = 0; p < check_.pairs.size(); ++p) {
      const CheckedPair& checked = check_.pairs[p];
      const bool is_first = checked.image1 == i;
      if (!is_first && checked.image2 != i) continue;
      const int32_t other = is_first ? checked.image2 : checked.image1;
      if (checked.state == PairState::kNotChecked || IsCalledWrong(other)) {
        continue;
      }
      if (checked.state == PairState::kContradictory) {
        most_explained += checked.most_explained;
        contradictory += checked.num_matches;
        to_baselines.Add(Center(geometries_[other].cam_from_world),
                         checked.best_baseline,
                         static_cast<double>(checked.num_explained));
      }
      const Eigen::Vector3d center = Center(geometries_[other].cam_from_world);
      ForEachMatch(database_.pairs[p], [&](const PixelRay& ray1,
                                           const PixelRay& ray2) {
        matches.push_back({is_first ? ray1 : ray2,
                           WorldRay(is_first ? ray2 : ray1, other), center});
      });
    }
    image.is_rotation_proved_wrong = 4 * most_explained < contradictory;
    image.num_matches = static_cast<int64_t>(matches.size());
    const RigidTransform& as_it_is = geometries_[i].cam_from_world;
    // From where it is, and from where the best baselines meet: far off there
    // are other minima.
    RigidTransform moved =
        FitEpipolarPose(matches, as_it_is, PoseChange::kMove, check_.noise_px);
    if (const auto met = to_baselines.Solve()) {
      const RigidTransform other = FitEpipolarPose(
          matches, {as_it_is.rotation, -as_it_is.rotation * *met},
          PoseChange::kMove, check_.noise_px);
      if (NumAgreeing(matches, other, check_.tolerance_px) >
          NumAgreeing(matches, moved, check_.tolerance_px)) {
        moved = other;
      }
    }
    const RigidTransform turned =
        FitEpipolarPose(matches, as_it_is, PoseChange::kTurn, check_.noise_px);
    image.num_agreeing_moved = NumAgreeing(matches, moved, check_.tolerance_px);
    image.num_agreeing_turned =
        NumAgreeing(matches, turned, check_.tolerance_px);
    image.moved_cam_from_world = moved;
    image.moved_by = (Center(moved) - Center(as_it_is)).norm();
    image.turned_by_deg =
        std::abs(
            Eigen::AngleAxisd(turned.rotation * as_it_is.rotation.transpose())
                .angle()) *
        kDegreesPerRadian;
    image.fault = FaultOf(image);
  }

  static PoseFault FaultOf(const CheckedImage& image) {
    const int64_t moved = image.num_agreeing_moved;
    const int64_t turned = image.num_agreeing_turned;
    if (2 * moved >= image.num_matches && moved > turned) {
      return PoseFault::kPosition;
    }
    if ((2 * turned >= image.num_matches && turned > moved) ||
        image.is_rotation_proved_wrong) {
      return PoseFault::kRotation;
    }
    return PoseFault::kUnclear;
  }

  template <typename Body>
  void ForEachPair(const Body& body) {
    ParallelFor(static_cast<int64_t>(check_.pairs.size()), 1,
                context_.num_threads,
                [&](int64_t begin, int64_t end, int /*worker*/) {
                  for (int64_t p = begin; p < end; ++p) body(p);
                });
  }

  const Model& model_;
  const Database& database_;
  const Context& context_;
  const std::vector<ImageGeometry> geometries_;
  std::vector<std::vector<double>> errors_px_;
  PairCheck check_;
};

}  // namespace

bool PairCheck::IsAnythingWrong() const {
  return !groups.empty() ||
         std::any_of(images.begin(), images.end(),
                     [](const CheckedImage& image) { return image.is_wrong; });
}

PairCheck CheckPairs(const Model& model, const Database& database,
                     const Context& context) {
  return PairChecker(model, database, context).Run();
}

}  // namespace krot
