#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/camera/camera_model.h"
#include "krot/database.h"
#include "krot/geometry.h"
#include "krot/geometry/transform.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {

// A match of two images whose rotations are known, as a condition on the
// baseline b, the direction from one centre to the other: b, and the rays d1
// and d2 of the two pixels, all in world axes, lie in one plane if
// b . (d1 x d2) = 0.
struct EpipolarMatch {
  Eigen::Vector3d normal;  // d1 x d2
  // Its derivatives by the four coordinates of the two pixels, as rows.
  Eigen::Matrix<double, 4, 3> gradient;

  EpipolarMatch(const PixelRay& ray1, const PixelRay& ray2)
      : normal(ray1.ray.cross(ray2.ray)) {
    for (int i = 0; i < 2; ++i) {
      gradient.row(i) = ray1.by_pixel.col(i).cross(ray2.ray);
      gradient.row(2 + i) = ray1.ray.cross(ray2.by_pixel.col(i));
    }
  }

  // How far the two pixels must move together, in pixels and to first order,
  // until both lie on their epipolar lines (Sampson's distance). The baseline's
  // length does not matter; 0 where it gives no lines.
  double ErrorPx(const Eigen::Vector3d& baseline) const {
    const double change = (gradient * baseline).norm();
    return change > 0 ? std::abs(normal.dot(baseline) / change) : 0;
  }
  // The error for the worst baseline: how far the pixels must move until the
  // rays are parallel.
  double ParallaxPx() const { return ErrorPx(normal); }
};

// Rays of a database's matches through the cameras of its model.
class MatchRays {
 public:
  // Keeps references.
  MatchRays(const Model& model, const Database& database)
      : geometries(ImageGeometries(model)),
        model_(model),
        database_(database) {}

  // The ray in world axes; Model::images[image] must have a pose.
  PixelRay World(const PixelRay& ray, int32_t image) const {
    const Eigen::Matrix3d world_from_cam =
        geometries[image].cam_from_world.rotation.transpose();
    return world_from_cam * ray;
  }

  // The rays of a match, in camera axes; none unless both pixels have rays.
  std::optional<std::pair<PixelRay, PixelRay>> Of(
      const VerifiedPair& pair, const std::array<uint32_t, 2>& match) const {
    const auto ray = [&](int32_t image, uint32_t keypoint) {
      return RayOf(model_.cameras[geometries[image].camera],
                   database_.keypoints[image][keypoint]);
    };
    const auto ray1 = ray(pair.image1, match[0]);
    const auto ray2 = ray(pair.image2, match[1]);
    if (!ray1 || !ray2) return std::nullopt;
    return std::pair(*ray1, *ray2);
  }

  // The same as a condition on the baseline of a pair whose images have poses.
  std::optional<EpipolarMatch> ConditionOf(
      const VerifiedPair& pair, const std::array<uint32_t, 2>& match) const {
    const auto rays = Of(pair, match);
    if (!rays) return std::nullopt;
    return EpipolarMatch(World(rays->first, pair.image1),
                         World(rays->second, pair.image2));
  }

  const std::vector<ImageGeometry> geometries;  // as Model::images

 private:
  const Model& model_;
  const Database& database_;
};

struct MatchNoise {
  double sigma_px = 0;      // per axis and keypoint
  double tolerance_px = 0;  // above all Gaussian errors, 95 %
};

// Estimates the noise from the errors of each pair of images (Sampson's
// distances, pixels; each list ascending, empty lists do not count). The
// tolerance is sigma sqrt(2 ln(N / alpha)): the largest of N Gaussian errors
// exceeds it with a probability below alpha = 0.05, so that all matches of a
// sound model are within it. Sigma comes from the pairs whose median error is
// at most twice the lower quartile of all medians, so that a few wrong poses do
// not raise it, as long as half of the images are right. `parallax_px` has the
// median parallax of each pair. Pairs with less than five times their median
// error do not count where others have more: photos from one place, as of a
// camera that stands still, have less noise between them. Zeros without errors.
MatchNoise EstimateMatchNoise(const std::vector<std::vector<double>>& errors_px,
                              const std::vector<double>& parallax_px);

// A match of one image, whose pose is in question, with another, whose pose is
// known.
struct WitnessMatch {
  PixelRay ray;        // of the image in question, in its camera's axes
  PixelRay other_ray;  // of the other image, in world axes
  Eigen::Vector3d other_center;
};

enum class PoseChange {
  kMove,  // another centre, the same rotation
  kTurn   // another rotation, the same centre
};

// The pose after the change, a move or a turn, that minimises the matches' sum
// of absolute errors (Sampson's distances): iteratively reweighted least
// squares from the given pose. Matches whose errors are below `noise_px`,
// positive, weigh the same. A local minimum; the given pose if there are no
// matches. O(iterations * matches), at most 50 iterations.
RigidTransform FitEpipolarPose(const std::vector<WitnessMatch>& matches,
                               const RigidTransform& cam_from_world,
                               PoseChange change, double noise_px);

// The errors of the matches under a pose of their image: Sampson's distances.
std::vector<double> EpipolarErrors(const std::vector<WitnessMatch>& matches,
                                   const RigidTransform& cam_from_world);

// The baseline that explains most matches.
struct BaselineSearch {
  int64_t num_explained = 0;  // by `baseline`: ErrorPx <= tolerance_px
  // No baseline explains more than this. Equal to num_explained unless the
  // search ended early.
  int64_t upper_bound = 0;
  Eigen::Vector3d baseline = Eigen::Vector3d::UnitZ();  // of length 1
  int64_t num_cells = 0;                                // that were looked at
  // The proof of upper_bound for BaselineCertificate: which cells were divided.
  std::string cells;
};

// Branch and bound over the half sphere of all directions, exact up to
// rounding. A cell on one of a cube's three faces is given up once no direction
// in it can explain more matches than the best one found; otherwise it is
// divided. Ends early after `max_cells` cells, and at cells that are no longer
// than 1e-12. The same result on every machine. O(cells * matches); a thousand
// matches, half of them wrong, take milliseconds.
// Requires tolerance_px > 0 and max_cells > 0.
BaselineSearch SearchBaseline(const std::vector<EpipolarMatch>& matches,
                              double tolerance_px, int64_t max_cells = 1000000);

// A pair that contradicts the poses, and the number of its matches: so many are
// lost if these are called wrong.
struct ContradictoryPair {
  int32_t image1 = 0;
  int32_t image2 = 0;  // another image
  int64_t num_matches = 0;
};

struct Explanations {
  Explanation cheapest;
  // The cheapest of the other explanations: each calls one of these images
  // right, or one image wrong of a pair whose matches are called wrong here.
  // None unless it costs at most a tenth more than `cheapest`, where the two
  // differ.
  std::optional<Explanation> runner_up;
  bool is_proved = true;  // false: the search ended at max_visits
};

// Decides which images are wrong, and what is wrong with them, once the pairs
// are measured and counted and the baselines of contradictory ones are found.
// Fills `cheapest`, `runner_up` and the images of `check`. `errors_px` are
// those of each pair under the model's poses. Same bits at any number of
// threads.
void JudgePoses(const MatchRays& rays, const Database& database,
                const std::vector<std::vector<double>>& errors_px,
                int num_threads, PairCheck* check);

// Finds the images that are best called wrong, at the least cost: an image
// costs `image_costs[i]` matches, a contradiction between two images that are
// not called wrong costs its own. Images for which one choice pays, whatever
// the others are, are settled first. The rest is branched on, until
// `max_visits` pairs have been visited for the cheapest explanation, and as
// many for the runner-up: about a second each.
Explanations ExplainContradictions(
    const std::vector<int64_t>& image_costs,
    const std::vector<ContradictoryPair>& contradictions,
    int64_t max_visits = 200000000);

}  // namespace krot::internal
