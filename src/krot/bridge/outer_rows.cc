#include "krot/bridge/outer_rows.h"

#include <optional>

#include "krot/base/parallel_for.h"
#include "krot/bridge/reprojection.h"
#include "krot/camera/projection_row.h"
#include "krot/camera/remainder_bound.h"

namespace krot {
namespace {

// Above the relative error of the operations that make a row.
constexpr double kRowRounding = 1e-13;
constexpr int64_t kRowsAtOnce = 64;

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
  ParallelFor(
      count, kRowsAtOnce, num_threads, [&](int64_t begin, int64_t end, int) {
        for (int64_t i = begin; i < end; ++i) {
          const auto row =
              OuterRow(reprojection.SourceOf(i), built.pixels[i], norm, level);
          if (!row) continue;
          problem->observations[i].E = *row;
          has_row[i] = 1;
        }
      });
  return has_row;
}

}  // namespace krot
