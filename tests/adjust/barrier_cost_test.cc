#include "krot/adjust/barrier_cost.h"

#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "krot/camera/models.h"

// The oracle knows no derivative: central differences of w, r and the barrier
// cost, written with Eigen's quaternions, along small motions of every block.

namespace krot {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector2d;
using Eigen::Vector3d;
using RowMajor3Xd = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;

struct Blocks {
  std::array<double, 3> point = {0.3, -0.2, 4.0};
  std::array<double, 7> frame = {0.9, 0.1, -0.3, 0.2, 0.1, -0.2, 0.5};
  std::array<double, 7> sensor = {0.8, -0.1, 0.2, 0.1, -0.05, 0.1, 0.02};
  std::array<double, 4> camera = {900, 512, 384, 0.05};
  double cap2 = 9.0;

  std::vector<double*> Pointers() {
    return {point.data(), frame.data(), sensor.data(), camera.data(), &cap2};
  }
};

// Moves coordinate i of a block by delta: of a pose, rotations about the axes
// first, then translations.
void Move(size_t block, int i, double delta, Blocks* blocks) {
  double* values = blocks->Pointers()[block];
  const bool is_pose = block == 1 || block == 2;
  if (!is_pose || i >= 3) {
    values[is_pose ? i + 1 : i] += delta;
    return;
  }
  const Quaterniond turned =
      Quaterniond(Eigen::AngleAxisd(delta, Vector3d::Unit(i))) *
      Quaterniond(values[0], values[1], values[2], values[3]);
  values[0] = turned.w();
  Eigen::Map<Vector3d>(values + 1) = turned.vec();
}

Vector3d Transform(const std::array<double, 7>& pose, const Vector3d& x) {
  return Quaterniond(pose[0], pose[1], pose[2], pose[3]) * x +
         Vector3d(pose[4], pose[5], pose[6]);
}

struct Seen {
  Vector2d r;
  double w;
};

class BarrierCostTest : public ::testing::Test {
 protected:
  BarrierCostTest() {
    for (auto* pose : {&blocks_.frame, &blocks_.sensor}) {
      Eigen::Map<Eigen::Vector4d>(pose->data()).normalize();
    }
    pixel_ = See(blocks_).r - Vector2d(2, -1);
  }

  Seen See(const Blocks& blocks) const {
    const Vector3d x = Transform(
        blocks.sensor,
        Transform(blocks.frame,
                  Vector3d(blocks.point[0], blocks.point[1], blocks.point[2])));
    Vector2d pixel;
    SimpleRadial::Project(blocks.camera.data(), x.x() / x.z(), x.y() / x.z(),
                          &pixel.x(), &pixel.y());
    return {pixel - pixel_, x.z()};
  }

  double SlackOf(const Blocks& blocks) const {
    return (blocks.cap2 - See(blocks).r.squaredNorm()) / 2;
  }

  // What a function of the blocks changes by, per unit of a motion.
  template <typename Function>
  double Slope(size_t block, int i, const Function& function) const {
    constexpr double kStep = 1e-6;
    Blocks forth = blocks_, back = blocks_;
    Move(block, i, kStep, &forth);
    Move(block, i, -kStep, &back);
    return (function(forth) - function(back)) / (2 * kStep);
  }

  // The same of a row of Jacobian.
  double RowSlope(size_t block, int i, const Eigen::RowVectorXd& row) const {
    constexpr double kStep = 1e-6;
    Blocks forth = blocks_, back = blocks_;
    Move(block, i, kStep, &forth);
    Move(block, i, -kStep, &back);
    double sum = 0;
    for (int k = 0; k < row.size(); ++k) {
      sum += row[k] * (forth.Pointers()[block][k] - back.Pointers()[block][k]);
    }
    return sum / (2 * kStep);
  }

  Blocks blocks_;
  Vector2d pixel_ = Vector2d::Zero();
  Barrier barrier_ = {0.25};
  double multiplier_ = 1.7;
};

TEST_F(BarrierCostTest, RowsAreThoseOfThePrimalDualSystem) {
  const BarrierCost cost(
      std::make_unique<ReprojectionCost<SimpleRadial, true>>(pixel_), &barrier_,
      &multiplier_);
  const std::vector<double*> pointers = blocks_.Pointers();
  Vector3d residuals;
  std::vector<RowMajor3Xd> rows;
  std::vector<double*> row_pointers;
  for (const int size : cost.parameter_block_sizes()) {
    rows.emplace_back(3, size);
  }
  for (RowMajor3Xd& row : rows) row_pointers.push_back(row.data());
  ASSERT_TRUE(
      cost.Evaluate(pointers.data(), residuals.data(), row_pointers.data()));

  const double h = SlackOf(blocks_), w = See(blocks_).w;
  const auto barrier_cost = [&](const Blocks& blocks) {
    return See(blocks).r.squaredNorm() / 2 -
           barrier_.mu * std::log(SlackOf(blocks));
  };
  const auto depth_times_slack = [&](const Blocks& blocks) {
    return See(blocks).w * SlackOf(blocks);
  };
  const auto error_x = [&](const Blocks& blocks) { return See(blocks).r.x(); };
  const int num_motions[] = {3, 6, 6, 4, 1};
  for (size_t b = 0; b < 5; ++b) {
    for (int i = 0; i < num_motions[b]; ++i) {
      // That by the cap is CapCost's.
      const double gradient = b < 4 ? Slope(b, i, barrier_cost) : 0;
      EXPECT_NEAR(RowSlope(b, i, residuals.transpose() * rows[b]), gradient,
                  1e-6 * (1 + std::abs(gradient)));
      const double constraint =
          -std::sqrt(multiplier_ / h) * Slope(b, i, depth_times_slack) / w;
      EXPECT_NEAR(RowSlope(b, i, rows[b].row(2)), constraint,
                  1e-6 * (1 + std::abs(constraint)));
      const double error = std::sqrt(1 + multiplier_) * Slope(b, i, error_x);
      EXPECT_NEAR(RowSlope(b, i, rows[b].row(0)), error,
                  1e-6 * (1 + std::abs(error)));
    }
  }
}

TEST_F(BarrierCostTest, HasNoCostToOffer) {
  const BarrierCost cost(
      std::make_unique<ReprojectionCost<SimpleRadial, true>>(pixel_), &barrier_,
      &multiplier_);
  Vector3d residuals;
  EXPECT_FALSE(
      cost.Evaluate(blocks_.Pointers().data(), residuals.data(), nullptr));
}

TEST(CapCost, IsARowWithTheCapsSlopeAndNextToNoCurvature) {
  CapSlope cap = {-3.5, 20};
  const CapCost cost(&cap);
  double cap2 = 9, residual = 0, row = 0;
  double* blocks[] = {&cap2};
  double* rows[] = {&row};
  ASSERT_TRUE(cost.Evaluate(blocks, &residual, rows));
  EXPECT_DOUBLE_EQ(row * residual, cap.slope);
  EXPECT_LT(row * row, 1e-6 * cap.curvature);
}

}  // namespace
}  // namespace krot
