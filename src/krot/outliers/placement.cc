#include "krot/outliers/robust_start.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/convert/build_problem.h"
#include "krot/outliers/parts.h"
#include "krot/problem/centre_unknowns.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// Finds a place near most rays. error(n, place) is the error of the n-th ray
// there; none counts for more than the cap.
template <typename Error>
class RobustPlace {
 public:
  RobustPlace(const std::vector<Ray>& rays, double cap, const Error& error)
      : rays_(rays), cap_(cap), error_(error) {}

  // Starts at `depth` along the first ray, which must exist.
  Vector3d Find(double depth) {
    best_ = rays_.front().centre + depth * rays_.front().direction;
    lowest_ = Score(best_);
    const auto count = static_cast<int64_t>(rays_.size());
    ForSomePairs(count, 60, [&](int64_t a, int64_t b) {
      Try({rays_[a], rays_[b]});
    });
    std::vector<Ray> agreeing;
    for (int64_t n = 0; n < count; ++n) {
      if (error_(n, best_) < cap_) agreeing.push_back(rays_[n]);
    }
    Try(agreeing);
    return best_;
  }

 private:
  double Score(const Vector3d& place) const {
    double sum = 0;
    for (size_t n = 0; n < rays_.size(); ++n) {
      sum += std::min(cap_, error_(static_cast<int64_t>(n), place));
    }
    return sum;
  }
  void Try(const std::vector<Ray>& rays) {
    const std::optional<Vector3d> midpoint = RetriangulateMidpoint(rays);
    if (!midpoint) return;
    const double score = Score(*midpoint);
    if (!(score < lowest_)) return;
    lowest_ = score;
    best_ = *midpoint;
  }

  const std::vector<Ray>& rays_;
  const double cap_;
  const Error& error_;
  Vector3d best_ = Vector3d::Zero();
  double lowest_ = 0;
};

// The median depth of all points but the given ones; 1 if there are none.
double MedianDepthOfOthers(const KnownRotationProblem& problem,
                           const std::vector<int32_t>& points,
                           const Estimate& estimate) {
  std::vector<double> depths;
  for (const Observation& o : problem.observations) {
    if (std::binary_search(points.begin(), points.end(), o.point)) continue;
    depths.push_back(ViewPoint(problem, o, estimate).depth);
  }
  return depths.empty() ? 1 : Median(std::move(depths));
}

}  // namespace

std::vector<int32_t> AllPoints(const KnownRotationProblem& problem) {
  return NumbersUpTo<int32_t>(problem.num_points);
}

Vector3d DirectionOf(const KnownRotationProblem& problem, int64_t i) {
  const Observation& o = problem.observations[i];
  const Vector3d ray = o.E.row(1).cross(o.E.row(2)).transpose();
  return (problem.views[o.view].cam_from_world_rotation.transpose() * ray)
      .normalized();
}

void PlacePointsRobustly(const KnownRotationProblem& problem,
                         const std::vector<int32_t>& points, Norm norm,
                         double cap, const Context& context,
                         Estimate* estimate) {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem, estimate->translations);
  const double depth = MedianDepthOfOthers(problem, points, *estimate);
  const auto place = [&](int32_t k) {
    const int64_t first = problem.point_begin[k];
    std::vector<Ray> rays;
    for (int64_t i = first; i < problem.point_begin[k + 1]; ++i) {
      const AffineMap& camera = cameras[problem.observations[i].view];
      rays.push_back({-camera.leftCols<3>().transpose() * camera.col(3),
                      DirectionOf(problem, i)});
    }
    const auto error = [&](int64_t n, const Vector3d& xyz) {
      const Observation& o = problem.observations[first + n];
      return ResidualOf(ViewPoint(cameras[o.view], o, xyz), norm);
    };
    estimate->points[k] = RobustPlace(rays, cap, error).Find(depth);
  };
  ParallelForEach(
      static_cast<int64_t>(points.size()), context.num_threads,
      [&](int64_t n) { place(points[n]); }, /*chunk_size=*/64);
}

void PlaceFramesRobustly(const KnownRotationProblem& problem,
                         const std::vector<int32_t>& frames,
                         const std::vector<char>& is_placed, Norm norm,
                         double cap, const Context& context,
                         Estimate* estimate) {
  const std::vector<Eigen::Matrix3d> rig_from_world =
      RigFromWorldRotations(problem);
  const auto place = [&](int32_t f) {
    std::vector<Ray> rays;
    std::vector<int64_t> seen;
    for (const int32_t i : problem.OfFrame(f)) {
      const Observation& o = problem.observations[i];
      if (!is_placed[o.point]) continue;
      const View& view = problem.views[o.view];
      // From the camera's centre to the frame's origin.
      const Vector3d to_origin = view.cam_from_world_rotation.transpose() *
                                 view.cam_from_rig_translation;
      rays.push_back(
          {estimate->points[o.point] + to_origin, -DirectionOf(problem, i)});
      seen.push_back(i);
    }
    if (rays.empty()) return;
    const auto error = [&](int64_t n, const Vector3d& origin) {
      const Observation& o = problem.observations[seen[n]];
      const AffineMap camera =
          CamFromWorld(problem.views[o.view], -rig_from_world[f] * origin);
      return ResidualOf(ViewPoint(camera, o, estimate->points[o.point]), norm);
    };
    estimate->translations[f] =
        -rig_from_world[f] * RobustPlace(rays, cap, error).Find(1);
  };
  ParallelForEach(
      static_cast<int64_t>(frames.size()), context.num_threads,
      [&](int64_t n) { place(frames[n]); }, /*chunk_size=*/1);
}

}  // namespace krot::internal
