#include "krot/outliers/robust_points.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/bridge/point_repair.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr int64_t kPointsPerTask = 64;
// So many of a long track's pairs are tried, about.
constexpr int64_t kTriedPairs = 60;

class RobustPoint {
 public:
  RobustPoint(const KnownRotationProblem& problem,
              const std::vector<AffineMap>& cameras, Norm norm, double cap,
              double depth)
      : problem_(problem),
        cameras_(cameras),
        norm_(norm),
        cap_(cap),
        depth_(depth) {}

  Vector3d Place(int32_t point) {
    begin_ = problem_.point_begin[point];
    end_ = problem_.point_begin[point + 1];
    rays_.clear();
    for (int64_t i = begin_; i < end_; ++i) rays_.push_back(RayOf(i));
    best_ = rays_.front().centre + depth_ * rays_.front().direction;
    lowest_ = Score(best_);
    const int64_t count = end_ - begin_;
    const int64_t num_pairs = count * (count - 1) / 2;
    const int64_t stride = std::max<int64_t>(1, num_pairs / kTriedPairs);
    int64_t pair = 0;
    for (int64_t gap = count - 1; gap > 0; --gap) {
      for (int64_t a = 0; a + gap < count; ++a, ++pair) {
        if (pair % stride == 0) Try({rays_[a], rays_[a + gap]});
      }
    }
    std::vector<Ray> agreeing;
    for (int64_t i = begin_; i < end_; ++i) {
      if (Error(i, best_) < cap_) agreeing.push_back(rays_[i - begin_]);
    }
    Try(agreeing);
    return best_;
  }

 private:
  // Where v = 0 and w > 0.
  Ray RayOf(int64_t i) const {
    const Observation& o = problem_.observations[i];
    const AffineMap& camera = cameras_[o.view];
    Vector3d ray = o.E.row(1).cross(o.E.row(2)).transpose();
    if (o.E.row(0).dot(ray) < 0) ray = -ray;
    const auto world_from_cam = camera.leftCols<3>().transpose();
    return {-world_from_cam * camera.col(3),
            (world_from_cam * ray).normalized()};
  }
  double Error(int64_t i, const Vector3d& xyz) const {
    const Observation& o = problem_.observations[i];
    return std::min(cap_,
                    ResidualOf(ViewPoint(cameras_[o.view], o, xyz), norm_));
  }
  double Score(const Vector3d& xyz) const {
    double sum = 0;
    for (int64_t i = begin_; i < end_; ++i) sum += Error(i, xyz);
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

  const KnownRotationProblem& problem_;
  const std::vector<AffineMap>& cameras_;
  const Norm norm_;
  const double cap_;
  const double depth_;
  int64_t begin_ = 0, end_ = 0;  // observations of the point
  std::vector<Ray> rays_;        // theirs
  Vector3d best_ = Vector3d::Zero();
  double lowest_ = 0;
};

// Of the observations of all points but the given ones; 1 if there are none.
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

void PlacePointsRobustly(const KnownRotationProblem& problem,
                         const std::vector<int32_t>& points, Norm norm,
                         double cap, const Context& context,
                         Estimate* estimate) {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem, estimate->translations);
  const double depth = MedianDepthOfOthers(problem, points, *estimate);
  ParallelFor(static_cast<int64_t>(points.size()), kPointsPerTask,
              context.num_threads, [&](int64_t begin, int64_t end, int) {
                RobustPoint place(problem, cameras, norm, cap, depth);
                for (int64_t n = begin; n < end; ++n) {
                  estimate->points[points[n]] = place.Place(points[n]);
                }
              });
}

}  // namespace krot::internal
