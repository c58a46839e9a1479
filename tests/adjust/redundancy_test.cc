#include "krot/adjust/redundancy.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/adjustment_columns.h"
#include "krot/adjust/reprojection_errors.h"
#include "krot/model/image_geometry.h"
#include "krot/synthetic/scene.h"

// The oracle knows no derivative and eliminates nothing: central differences of
// all errors by all unknowns, and R = I - J J^+ by singular values.

namespace krot::internal {
namespace {

constexpr double kNoCap = 1e300;

Model SmallScene(int camera_model_id) {
  SceneOptions options;
  options.num_frames = 4;
  options.num_points = 25;
  options.track_length = 5;
  options.camera_model_id = camera_model_id;
  options.sensors_per_rig = 2;
  options.pixel_noise = 1;
  options.random_seed = 5;
  return SynthesizeScene(options).ground_truth;
}

Eigen::MatrixXd DenseRedundancy(const Model& model,
                                const BundleAdjustmentOptions& options) {
  const AdjustmentBlocks blocks = MakeAdjustmentBlocks(model, 2);
  const AdjustmentColumns columns(options, blocks);
  const auto num_rows =
      static_cast<Eigen::Index>(2 * blocks.observations.size());
  std::vector<Eigen::VectorXd> J;
  BlockVector direction;
  direction.SetZero(blocks.points.size(), columns.num_blocks);
  constexpr double kStep = 1e-6;
  const auto errors_at = [&](double step) {
    AdjustmentBlocks moved = blocks;
    MoveAlong(columns, blocks, direction, step, &moved);
    const auto errors = ProjectErrors(moved, kNoCap, 1);
    Eigen::VectorXd stacked(num_rows);
    for (size_t i = 0; i < errors->size(); ++i) {
      stacked.segment<2>(static_cast<Eigen::Index>(2 * i)) = (*errors)[i].r;
    }
    return stacked;
  };
  for (auto* list : {&direction.points, &direction.frames}) {
    for (Eigen::Vector3d& unknown : *list) {
      for (int c = 0; c < 3; ++c) {
        unknown[c] = 1;
        J.push_back((errors_at(kStep) - errors_at(-kStep)) / (2 * kStep));
        unknown[c] = 0;
      }
    }
  }
  Eigen::MatrixXd matrix(num_rows, static_cast<Eigen::Index>(J.size()));
  for (size_t c = 0; c < J.size(); ++c) {
    // Unknowns of like size, so that the gauge stands out.
    const double norm = J[c].norm();
    matrix.col(static_cast<Eigen::Index>(c)) = norm > 0 ? J[c] / norm : J[c];
  }
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(matrix, Eigen::ComputeThinU);
  Eigen::MatrixXd R = Eigen::MatrixXd::Identity(num_rows, num_rows);
  for (Eigen::Index c = 0; c < svd.singularValues().size(); ++c) {
    if (svd.singularValues()[c] < 1e-7) continue;
    R -= svd.matrixU().col(c) * svd.matrixU().col(c).transpose();
  }
  return R;
}

void ExpectExact(const Model& model, const BundleAdjustmentOptions& options) {
  const Eigen::MatrixXd dense = DenseRedundancy(model, options);
  const auto exact = ExactRedundancy(model, options, {});
  ASSERT_EQ(2 * static_cast<Eigen::Index>(exact.size()), dense.rows());
  double redundancy = 0;
  for (size_t e = 0; e < exact.size(); ++e) {
    const auto row = static_cast<Eigen::Index>(2 * e);
    EXPECT_LT((exact[e] - dense.block<2, 2>(row, row)).norm(), 1e-4);
    redundancy += exact[e].trace();
  }
  EXPECT_GT(redundancy, 10);
  EXPECT_NEAR(redundancy, std::round(redundancy), 1e-4);
}

TEST(ExactRedundancy, IsByItsDefinitionWhateverMoves) {
  BundleAdjustmentOptions options;
  const Model model = SmallScene(2);
  ExpectExact(model, options);
  options.constant_rig_from_world_rotation = true;
  options.refine_sensor_from_rig = false;
  options.refine_extra_params = false;
  ExpectExact(model, options);
  options.refine_rig_from_world = false;
  options.refine_focal_length = false;
  ExpectExact(model, options);
}

TEST(ExactRedundancy, IsByItsDefinitionForFisheyes) {
  ExpectExact(SmallScene(5), {});
}

TEST(ExactRedundancy, IsUnknownOfWhatTakesNoPart) {
  Model model = SmallScene(2);
  model.frames[0].rig_from_world.translation.x() =
      std::numeric_limits<double>::quiet_NaN();
  const auto exact = ExactRedundancy(model, {}, {});
  const auto images = ImageGeometries(model);
  const auto indices = ImageIndices(model);
  int num_unknown = 0;
  for (size_t e = 0; e < exact.size(); ++e) {
    const int32_t n = indices.at(model.track_elements[e].image_id);
    if (images[n].has_pose) continue;
    EXPECT_TRUE(std::isnan(exact[e](0, 0)));
    ++num_unknown;
  }
  EXPECT_GT(num_unknown, 5);
}

}  // namespace
}  // namespace krot::internal
