#include "krot/convert/reprojection.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"
#include "krot/camera/models.h"
#include "krot/camera/remainder_bound.h"
#include "krot/minimax/residual_set.h"
#include "krot/model/rigs.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

// Relative rounding of a coordinate that is computed in a few operations.
constexpr double kDigits = 4 * std::numeric_limits<double>::epsilon();

}  // namespace

Reprojection::Reprojection(const Model& model, const BuiltProblem& built)
    : built_(built), is_linear_(built.positions.empty()) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  for (const int32_t image : built.image_of) {
    const Camera& camera = model.cameras[geometries[image].camera];
    sources_.push_back({camera.model_id, camera.params.data()});
    is_linear_ = is_linear_ && camera.model_id <= Pinhole::kId;
  }
}

Eigen::Vector3d Reprojection::InCamera(const Estimate& estimate,
                                       int64_t i) const {
  const KnownRotationProblem& problem = built_.problem;
  const Observation& observation = problem.observations[i];
  const View& view = problem.views[observation.view];
  const AffineMap map = CamFromWorld(view, estimate.translations[view.frame]);
  return map.leftCols<3>() * estimate.points[observation.point] + map.col(3);
}

double Reprojection::Error(const Estimate& estimate, Norm norm,
                           int64_t i) const {
  const Source& source = sources_[built_.problem.observations[i].view];
  const Eigen::Vector3d x_cam = InCamera(estimate, i);
  const std::optional<Eigen::Vector2d> e =
      ProjectionError(source.model_id, source.params, built_.pixels[i], x_cam);
  if (!e) return kInfinity;
  const double error =
      NormOf(*e, norm) / built_.ScaleOf(i) + Resolution(estimate, i, x_cam);
  return std::isfinite(error) ? error : kInfinity;
}

// What a change in the coordinates' last digits does to the error, pixels. It
// is negligible unless a point all but coincides with its camera.
double Reprojection::Resolution(const Estimate& estimate, int64_t i,
                                const Eigen::Vector3d& x_cam) const {
  const Observation& o = built_.problem.observations[i];
  const int32_t frame = built_.problem.views[o.view].frame;
  const double digits =
      kDigits * (estimate.points[o.point].lpNorm<Eigen::Infinity>() +
                 estimate.translations[frame].lpNorm<Eigen::Infinity>());
  const double pixels_per_angle = o.E.bottomRows<2>().norm();
  return pixels_per_angle * digits / std::abs(o.E.row(0).dot(x_cam));
}

double Reprojection::TrueCost(const Estimate& estimate, Norm norm,
                              int num_threads) const {
  const auto count = static_cast<int64_t>(built_.problem.observations.size());
  std::vector<double> largest(NumChunks(count, kItemsPerChunk), 0);
  ParallelFor(count, kItemsPerChunk, num_threads,
              [&](int64_t begin, int64_t end, int) {
                double& cost = largest[begin / kItemsPerChunk];
                for (int64_t i = begin; i < end; ++i) {
                  if (!built_.HasPixel(i)) continue;
                  cost = std::max(cost, Error(estimate, norm, i));
                }
              });
  double cost = 0;
  for (const double chunk : largest) cost = std::max(cost, chunk);
  return cost;
}

double Reprojection::LevelledCost(const Estimate& estimate, Norm norm,
                                  int num_threads) const {
  return std::max(
      TrueCost(estimate, norm, num_threads),
      built_.position_level * LargestPositionRatio(built_, estimate));
}

bool Reprojection::TakeRows(const Estimate& estimate, int num_threads,
                            KnownRotationProblem* problem) const {
  if (is_linear_) return true;
  TakePositionRows(built_, estimate, problem);
  const auto count = static_cast<int64_t>(problem->observations.size());
  std::atomic<bool> do_project{true};
  ParallelForEach(count, num_threads, [&](int64_t i) {
    if (!built_.HasPixel(i)) return;
    Observation& observation = problem->observations[i];
    const Source& source = sources_[observation.view];
    const auto row = RowAtProjection(source.model_id, source.params,
                                     built_.pixels[i], InCamera(estimate, i));
    if (row) {
      observation.E = *row;
      observation.E.bottomRows<2>() /= built_.ScaleOf(i);
    } else {
      do_project = false;
    }
  });
  return do_project;
}

namespace {

// An upper bound on the relative rounding of the operations that make a row.
constexpr double kRowRounding = 1e-13;

std::optional<Eigen::Matrix3d> OuterRow(const Reprojection::Source& source,
                                        const Eigen::Vector2d& pixel, Norm norm,
                                        double level) {
  const auto bearing = PixelBearing(source.model_id, source.params, pixel);
  if (!bearing) return std::nullopt;
  auto E = RowAtProjection(source.model_id, source.params, pixel, *bearing);
  const auto kappa = RemainderBound(source.model_id, source.params, pixel,
                                    *bearing, level, norm.p);
  if (!E || !kappa) return std::nullopt;
  const double terms =
      E->bottomRows<2>().cwiseAbs().sum() + pixel.lpNorm<1>() + level;
  E->bottomRows<2>() /= (1 + *kappa) * (1 + kRowRounding * terms / level);
  return E;
}

}  // namespace

std::vector<char> TakeOuterRows(const Model& model, const BuiltProblem& built,
                                Norm norm, double level, int num_threads,
                                KnownRotationProblem* problem) {
  const Reprojection reprojection(model, built);
  const auto count = static_cast<int64_t>(problem->observations.size());
  std::vector<char> has_row(count, 0);
  ParallelForEach(count, num_threads, [&](int64_t i) {
    const auto row =
        OuterRow(reprojection.SourceOf(i), built.pixels[i], norm, level);
    if (!row) return;
    problem->observations[i].E = *row;
    has_row[i] = 1;
  });
  return has_row;
}

}  // namespace krot::internal
