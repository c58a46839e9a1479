#include "krot/adjust/barrier_system.h"

#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "tests/adjust/small_blocks.h"
#include "tests/oracle/dense_algebra.h"

// The oracles are a dense least-squares problem whose rows are written down one
// by one, and central differences of the barrier cost.

namespace krot::internal {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kMu = 0.3;
constexpr double kCapWeight = 50;
constexpr double kRadius = 1e4;

struct Iterate {
  AdjustmentBlocks blocks = SmallBlocks(4);
  AdjustmentColumns columns;
  std::vector<ProjectedError> errors;
  std::vector<double> multipliers;

  Iterate(const BundleAdjustmentOptions& options, bool cap_moves,
          bool has_fixed = false)
      : columns(options, Fix(has_fixed)),
        errors(*ProjectErrors(blocks, std::sqrt(blocks.cap2), 1)) {
    if (cap_moves) columns.AddCap();
    for (size_t i = 0; i < errors.size(); ++i) {
      multipliers.push_back(0.1 + 0.7 * static_cast<double>(i % 5));
    }
  }

  const AdjustmentBlocks& Fix(bool has_fixed) {
    if (!has_fixed) return blocks;
    blocks.frame_is_fixed[1] = blocks.sensor_is_fixed[0] = 1;
    blocks.point_is_fixed[2] = blocks.point_is_fixed[7] = 1;
    return blocks;
  }

  std::unique_ptr<BarrierSystem> Solved(int num_threads = 1) const {
    auto system = std::make_unique<BarrierSystem>(columns, blocks, num_threads);
    system->Linearize(blocks, errors, multipliers);
    EXPECT_TRUE(system->Factorize(kRadius));
    system->Solve(kMu, columns.cap < 0 ? 0 : kCapWeight);
    return system;
  }
};

VectorXd Stack(const BlockVector& x) {
  VectorXd stacked(3 * (x.points.size() + x.frames.size()));
  for (size_t k = 0; k < x.points.size(); ++k) {
    stacked.segment<3>(3 * k) = x.points[k];
  }
  for (size_t b = 0; b < x.frames.size(); ++b) {
    stacked.segment<3>(3 * (x.points.size() + b)) = x.frames[b];
  }
  return stacked;
}

struct DenseSystem {
  MatrixXd H;
  VectorXd g;
};

DenseSystem Assemble(const Iterate& at) {
  const size_t num_points = at.blocks.points.size();
  const auto size =
      static_cast<int64_t>(3 * (num_points + at.columns.num_blocks));
  ErrorJacobians jacobians(at.columns, at.blocks);
  jacobians.Evaluate(at.blocks, 1);
  DenseSystem dense = {MatrixXd::Zero(size, size), VectorXd::Zero(size)};
  const int64_t cap_column = 3 * (num_points + at.columns.cap);
  for (size_t i = 0; i < at.errors.size(); ++i) {
    MatrixXd D = MatrixXd::Zero(3, size);
    if (at.columns.point_moves[at.blocks.observations[i].point]) {
      D.middleCols<3>(3 * at.blocks.observations[i].point) =
          jacobians.by_point(i);
    }
    for (int n = 0; n < jacobians.num_blocks(i); ++n) {
      D.middleCols<3>(3 * (num_points + jacobians.blocks(i)[n])) =
          jacobians.by_block(i, n);
    }
    const Eigen::Vector2d& r = at.errors[i].r;
    const double lambda = at.multipliers[i];
    const double h = (at.blocks.cap2 - r.squaredNorm()) / 2;
    MatrixXd rows(3, size);
    rows.topRows<2>() = std::sqrt(1 + lambda) * D.topRows<2>();
    rows.row(2) =
        r.transpose() * D.topRows<2>() - h / at.errors[i].w * D.row(2);
    if (at.columns.cap >= 0) rows(2, cap_column) = -0.5;
    rows.row(2) *= std::sqrt(lambda / h);
    dense.H += rows.transpose() * rows;
    dense.g += (1 + kMu / h) * D.topRows<2>().transpose() * r;
    if (at.columns.cap >= 0) dense.g[cap_column] -= kMu / (2 * h);
  }
  if (at.columns.cap >= 0) dense.g[cap_column] += kCapWeight / 2;
  return dense;
}

std::vector<Iterate> Iterates() {
  BundleAdjustmentOptions all, no_points, translations;
  no_points.refine_points3D = false;
  translations.constant_rig_from_world_rotation = true;
  translations.refine_sensor_from_rig = false;
  translations.refine_focal_length = false;
  translations.refine_extra_params = false;
  return {{all, false},       {all, true},           {no_points, false},
          {no_points, true},  {translations, false}, {translations, true},
          {all, false, true}, {all, true, true}};
}

TEST(BarrierSystem, FindsTheDirectionOfTheDenseSystem) {
  for (const Iterate& at : Iterates()) {
    const auto system = at.Solved();
    DenseSystem dense = Assemble(at);
    double gains = 0;
    for (int64_t c = 0; c < dense.g.size(); ++c) {
      double& diagonal = dense.H(c, c);
      if (diagonal > 0) gains += dense.g[c] * dense.g[c] / diagonal / 2;
      diagonal = diagonal > 0 ? diagonal * (1 + 1 / kRadius) : 1;
    }
    const VectorXd expected = -SolveByLu(dense.H, dense.g);
    EXPECT_LT((Stack(system->direction().unknowns) - expected).norm(),
              1e-6 * expected.norm());
    EXPECT_NEAR(system->SingleGains(), gains, 1e-9 * gains);
    EXPECT_EQ(system->cap2_slope() != 0, at.columns.cap >= 0);
  }
}

TEST(BarrierSystem, KnowsWhereErrorsAndDepthsGo) {
  for (const Iterate& at : Iterates()) {
    const auto system = at.Solved();
    constexpr double kStep = 1e-6;
    const auto errors_at = [&](double step) {
      AdjustmentBlocks moved = at.blocks;
      MoveAlong(at.columns, at.blocks, system->direction().unknowns, step,
                &moved);
      return *ProjectErrors(moved, 1e300, 1);
    };
    const auto forth = errors_at(kStep), back = errors_at(-kStep);
    for (size_t i = 0; i < forth.size(); ++i) {
      Vector3d expected;
      expected << (forth[i].r - back[i].r) / (2 * kStep),
          (forth[i].w - back[i].w) / (2 * kStep);
      EXPECT_LT((system->direction().slopes[i] - expected).norm(),
                1e-4 * (1 + expected.norm()));
    }
  }
}

TEST(BarrierSystem, DescendsTheBarrierCostAtTheRateOfItsGradient) {
  for (const Iterate& at : Iterates()) {
    const auto system = at.Solved();
    const auto cost_at = [&](double step) {
      AdjustmentBlocks moved = at.blocks;
      MoveAlong(at.columns, at.blocks, system->direction().unknowns, step,
                &moved);
      double sum = at.columns.cap < 0 ? 0 : kCapWeight * moved.cap2 / 2;
      const auto errors = *ProjectErrors(moved, std::sqrt(moved.cap2), 1);
      for (const ProjectedError& error : errors) {
        const double squared = error.r.squaredNorm();
        sum += squared / 2 - kMu * std::log((moved.cap2 - squared) / 2);
      }
      return sum;
    };
    constexpr double kStep = 1e-7;
    const double slope = (cost_at(kStep) - cost_at(-kStep)) / (2 * kStep);
    const double expected =
        Assemble(at).g.dot(Stack(system->direction().unknowns));
    EXPECT_LT(expected, 0);
    EXPECT_NEAR(slope, expected, 1e-4 * std::abs(expected));
  }
}

}  // namespace
}  // namespace krot::internal
