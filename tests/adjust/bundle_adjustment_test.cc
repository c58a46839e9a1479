#include "krot/adjust/bundle_adjustment.h"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/camera/camera_model.h"
#include "krot/compare.h"
#include "krot/context.h"
#include "krot/geometry/transform.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

// With more of them the last digits of Ceres differ from run to run.
const Context kAdjustAlone{1};

SceneOptions SmallOptions() {
  SceneOptions options = SceneOf(8, 80, 5, 0.5, 5);
  options.start_translation_noise = 0.003;
  options.start_point_noise = 0.003;
  options.rotation_noise_deg = 0.05;
  return options;
}

// Half the sum of the squared true errors, from scratch.
double CostOf(const Model& model) {
  double sum = 0;
  for (const double error_px : PixelErrors(model, 1)) {
    sum += error_px * error_px;
  }
  return sum / 2;
}

BundleAdjustmentOptions Exact() {
  BundleAdjustmentOptions options;
  options.function_tolerance = 0;
  options.gradient_tolerance = 1e-7;
  return options;
}

BundleAdjustmentOptions RotationsFixed() {
  BundleAdjustmentOptions options = Exact();
  options.constant_rig_from_world_rotation = true;
  options.refine_focal_length = false;
  options.refine_extra_params = false;
  return options;
}

// The textbook residual of a SIMPLE_RADIAL camera with a fixed rotation, for
// automatic differentiation.
struct FixedRotationResidual {
  Eigen::Matrix3d R;
  std::vector<double> camera;
  Eigen::Vector2d pixel;

  template <typename T>
  bool operator()(const T* translation, const T* point, T* residual) const {
    T x[3];
    for (int i = 0; i < 3; ++i) {
      x[i] = translation[i] + R(i, 0) * point[0] + R(i, 1) * point[1] +
             R(i, 2) * point[2];
    }
    const T u = x[0] / x[2], v = x[1] / x[2];
    const T stretch = T(1) + camera[3] * (u * u + v * v);
    residual[0] = camera[0] * stretch * u + camera[1] - pixel.x();
    residual[1] = camera[0] * stretch * v + camera[2] - pixel.y();
    return true;
  }
};

// A third of the radius of a ball is one standard deviation, like `sigma_px`.
struct FixedRotationPosition {
  Eigen::Matrix3d R;  // the identity for a point
  double sign;        // centre = -R't, point = x
  Eigen::Vector3d position;
  double px_per_unit;

  template <typename T>
  bool operator()(const T* unknown, T* residual) const {
    for (int i = 0; i < 3; ++i) {
      residual[i] =
          px_per_unit * (sign * (R(0, i) * unknown[0] + R(1, i) * unknown[1] +
                                 R(2, i) * unknown[2]) -
                         position[i]);
    }
    return true;
  }
};

// Of what is at R'unknown times the sign. A third of the tolerance is one
// standard deviation.
struct FixedRotationDistance {
  std::array<Eigen::Matrix3d, 2> R;
  std::array<double, 2> signs;
  double length;
  double px_per_unit;

  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    T square(0);
    for (int i = 0; i < 3; ++i) {
      T difference(0);
      for (int j = 0; j < 3; ++j) {
        difference +=
            signs[0] * R[0](j, i) * a[j] - signs[1] * R[1](j, i) * b[j];
      }
      square += difference * difference;
    }
    *residual = px_per_unit * (sqrt(square) - length);
    return true;
  }
};

double IndependentFixedRotationCost(
    const Model& model, ceres::LossFunction* loss, const FixedParts& fixed = {},
    const std::vector<KnownPosition>& positions = {}, double sigma_px = 1,
    const std::vector<KnownDistance>& distances = {}) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const auto image_indices = ImageIndices(model);
  std::vector<Eigen::Vector3d> translations, points;
  for (const ImageGeometry& geometry : geometries) {
    translations.push_back(geometry.cam_from_world.translation);
  }
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  for (const Point3D& point : model.points3D) points.push_back(point.xyz);
  for (size_t k = 0; k < points.size(); ++k) {
    const Point3D& point = model.points3D[k];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model.track_elements[e];
      const int32_t n = image_indices.at(element.image_id);
      const Point2D& pixel = model.images[n].points2D[element.point2D_idx];
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<FixedRotationResidual, 2, 3, 3>(
              new FixedRotationResidual{
                  geometries[n].cam_from_world.rotation,
                  model.cameras[geometries[n].camera].params,
                  {pixel.x, pixel.y}}),
          loss, translations[n].data(), points[k].data());
    }
  }
  for (const KnownPosition& known : positions) {
    const bool is_point = known.of == KnownPosition::Of::kPoint3D;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<FixedRotationPosition, 3, 3>(
            new FixedRotationPosition{
                is_point ? Eigen::Matrix3d::Identity()
                         : geometries[known.index].cam_from_world.rotation,
                is_point ? 1.0 : -1.0, known.region.centre,
                3 * sigma_px / known.region.semi_axes[0]}),
        nullptr,
        is_point ? points[known.index].data()
                 : translations[known.index].data());
  }
  for (const KnownDistance& known : distances) {
    FixedRotationDistance cost;
    std::array<double*, 2> unknowns;
    for (size_t n = 0; n < 2; ++n) {
      const auto [is_image, index] = known.ends[n];
      cost.R[n].setIdentity();
      if (is_image) cost.R[n] = geometries[index].cam_from_world.rotation;
      cost.signs[n] = is_image ? -1 : 1;
      unknowns[n] = (is_image ? translations : points)[index].data();
    }
    cost.length = *known.metres;
    cost.px_per_unit = 3 * sigma_px / known.tolerance;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<FixedRotationDistance, 1, 3, 3>(
            new FixedRotationDistance(cost)),
        nullptr, unknowns[0], unknowns[1]);
  }
  if (positions.empty()) {
    problem.SetParameterBlockConstant(translations[0].data());
  }
  for (size_t n = 0; n < translations.size(); ++n) {
    if (!fixed.HasFrame(geometries[n].frame)) continue;
    problem.SetParameterBlockConstant(translations[n].data());
  }
  for (size_t k = 0; k < points.size(); ++k) {
    if (!fixed.HasPoint(static_cast<int32_t>(k))) continue;
    problem.SetParameterBlockConstant(points[k].data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-15;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary.final_cost;
}

TEST(AdjustBundle, WithFixedRotationsEndsWhereAnIndependentProblemDoes) {
  const Model model = SynthesizeScene(SmallOptions()).model;
  const BundleAdjustmentResult result =
      AdjustBundle(model, RotationsFixed(), kAdjustAlone);
  const double expected = IndependentFixedRotationCost(model, nullptr);
  EXPECT_NEAR(result.summary.cost_final, expected, 1e-8 * expected);
  EXPECT_NEAR(CostOf(result.model), expected, 1e-8 * expected);
  EXPECT_LT(*result.summary.stationarity, 1e-9);
  for (size_t f = 0; f < model.frames.size(); ++f) {
    EXPECT_EQ(result.model.frames[f].rig_from_world.quaternion_wxyz,
              model.frames[f].rig_from_world.quaternion_wxyz);
  }
}

FixedParts SomeFixed(const Model& model) {
  FixedParts fixed;
  fixed.frames.assign(model.frames.size(), 0);
  fixed.points3D.assign(model.points3D.size(), 0);
  fixed.frames[0] = fixed.frames[3] = 1;
  for (const size_t k : {1, 2, 30}) fixed.points3D[k] = 1;
  return fixed;
}

TEST(AdjustBundle, WithFixedPartsEndsWhereAnIndependentProblemDoes) {
  const Model model = SynthesizeScene(SmallOptions()).model;
  BundleAdjustmentOptions options = RotationsFixed();
  options.fixed = SomeFixed(model);
  const BundleAdjustmentResult result =
      AdjustBundle(model, options, kAdjustAlone);
  const double expected =
      IndependentFixedRotationCost(model, nullptr, options.fixed);
  EXPECT_NEAR(CostOf(result.model), expected, 1e-8 * expected);
  EXPECT_GT(expected, 1.001 * IndependentFixedRotationCost(model, nullptr));
}

// Positions that the images contradict, so that both give way.
TEST(AdjustBundle, WithKnownPositionsEndsWhereAnIndependentProblemDoes) {
  const Model model = SynthesizeScene(SmallOptions()).model;
  BundleAdjustmentOptions options = RotationsFixed();
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  for (const int32_t n : {0, 2, 5}) {
    options.positions.push_back(
        {KnownPosition::Of::kImage, n,
         BallAround(Center(images[n].cam_from_world) +
                        Eigen::Vector3d(0.01 * n, 0.02, 0),
                    0.03)});
  }
  options.positions.push_back(
      {KnownPosition::Of::kPoint3D, 7,
       BallAround(model.points3D[7].xyz - Eigen::Vector3d(0, 0, 0.01), 0.01)});
  options.sigma_px = 0.7;
  const BundleAdjustmentResult result =
      AdjustBundle(model, options, kAdjustAlone);
  EXPECT_EQ(result.summary.num_positions, 4);
  const double expected = IndependentFixedRotationCost(
      model, nullptr, {}, options.positions, *options.sigma_px);
  EXPECT_NEAR(result.summary.cost_final, expected, 1e-8 * expected);
  EXPECT_LT(CostOf(result.model), 0.999 * expected);
}

// The ends of a distance: images are i, points -1 - k.
std::array<KnownDistance::End, 2> Ends(int32_t a, int32_t b) {
  const auto end = [](int32_t n) {
    return n >= 0 ? KnownDistance::End{true, n}
                  : KnownDistance::End{false, -1 - n};
  };
  return {end(a), end(b)};
}

// Of all kinds, two at one point; each `factor` times as long as in the model,
// to within a thousandth.
std::vector<KnownDistance> SomeDistances(const Model& model, double factor) {
  std::vector<KnownDistance> distances = {
      {Ends(0, 4), 1.0}, {Ends(-3, -8), 1.0}, {Ends(-3, 5), 1.0}};
  const std::vector<double> lengths = LengthsOf(model, distances);
  for (size_t n = 0; n < lengths.size(); ++n) {
    distances[n].metres = factor * lengths[n];
    distances[n].tolerance = 1e-3 * lengths[n];
  }
  return distances;
}

// Lengths that the images contradict, so that both give way.
TEST(AdjustBundle, WithKnownDistancesEndsWhereAnIndependentProblemDoes) {
  const Model model = SynthesizeScene(SmallOptions()).model;
  BundleAdjustmentOptions options = RotationsFixed();
  options.distances = SomeDistances(model, 1);
  *options.distances[0].metres *= 1.01;
  *options.distances[2].metres *= 0.99;
  options.sigma_px = 0.7;
  const BundleAdjustmentResult result =
      AdjustBundle(model, options, kAdjustAlone);
  EXPECT_EQ(result.summary.distances.size(), 3);
  const double expected = IndependentFixedRotationCost(
      model, nullptr, {}, {}, *options.sigma_px, options.distances);
  EXPECT_NEAR(result.summary.cost_final, expected, 1e-8 * expected);
  EXPECT_LT(CostOf(result.model), 0.999 * expected);
}

// What is exact stays exact, and takes the scale of the distances, with images
// in rigs; without moving or turning.
TEST(AdjustBundle, TakesTheModelToKnownDistances) {
  SceneOptions scene = SmallOptions();
  scene.sensors_per_rig = 2;
  scene.pixel_noise = 0;
  const Model truth = SynthesizeScene(scene).ground_truth;
  BundleAdjustmentOptions options = Exact();
  options.sigma_px = 1;
  for (const double factor : {0.97, 1.02}) {
    options.distances = SomeDistances(truth, factor);
    const Model result = AdjustBundle(truth, options, kAdjustAlone).model;
    const std::vector<double> lengths = LengthsOf(result, options.distances);
    for (size_t n = 0; n < lengths.size(); ++n) {
      EXPECT_NEAR(lengths[n], *options.distances[n].metres, 1e-6);
    }
    EXPECT_LT(Summarize(PixelErrors(result, 1)).max, 1e-4);
    for (size_t f = 0; f < truth.frames.size(); ++f) {
      EXPECT_TRUE(truth.frames[f].rig_from_world.Rotation().isApprox(
          result.frames[f].rig_from_world.Rotation(), 1e-7));
    }
  }
}

TEST(AdjustBundle, LeavesOutDistancesThatCannotChange) {
  SceneOptions scene = SmallOptions();
  scene.sensors_per_rig = 2;
  const Model model = SynthesizeScene(scene).model;
  BundleAdjustmentOptions options = Exact();
  options.sigma_px = 1;
  options.fixed = SomeFixed(model);
  const auto num_taking_part = [&](std::array<KnownDistance::End, 2> ends) {
    options.distances = {{ends, 1.0, 0.1}};
    return AdjustBundle(model, options, kAdjustAlone).summary.distances.size();
  };
  EXPECT_EQ(num_taking_part(Ends(-2, -3)), 0);  // fixed points
  EXPECT_EQ(num_taking_part(Ends(-2, -4)), 1);
  EXPECT_EQ(num_taking_part(Ends(2, 3)), 0);  // a rig that sees what is fixed
  options.fixed = {};
  EXPECT_EQ(num_taking_part(Ends(2, 3)), 1);
  options.refine_sensor_from_rig = false;
  EXPECT_EQ(num_taking_part(Ends(2, 3)), 0);
  EXPECT_EQ(num_taking_part(Ends(2, 5)), 1);
}

// What is exact stays exact, with images in rigs and rotations that move, and
// comes to the frame of the positions.
TEST(AdjustBundle, TakesTheModelToKnownPositions) {
  SceneOptions scene = SmallOptions();
  scene.sensors_per_rig = 2;
  scene.pixel_noise = 0;
  const Model truth = SynthesizeScene(scene).ground_truth;
  const Similarity moved = {
      1.02,
      Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitX()).matrix(),
      {0.02, 0.01, -0.03}};
  const Model start = TransformModel(truth, moved);
  BundleAdjustmentOptions options = Exact();
  options.sigma_px = 1;
  const std::vector<ImageGeometry> images = ImageGeometries(truth);
  for (size_t n = 0; n < images.size(); ++n) {
    options.positions.push_back(
        {KnownPosition::Of::kImage, static_cast<int32_t>(n),
         BallAround(Center(images[n].cam_from_world), 1e-3)});
  }
  const Model result = AdjustBundle(start, options, kAdjustAlone).model;
  const std::vector<ImageGeometry> after = ImageGeometries(result);
  for (size_t n = 0; n < images.size(); ++n) {
    EXPECT_LT(
        (Center(after[n].cam_from_world) - Center(images[n].cam_from_world))
            .norm(),
        1e-6);
  }
  EXPECT_LT(Summarize(PixelErrors(result, 1)).max, 1e-4);
}

TEST(AdjustBundle, LeavesOutPositionsOfWhatCannotMove) {
  const Model model = SynthesizeScene(SmallOptions()).model;
  BundleAdjustmentOptions options = Exact();
  options.fixed = SomeFixed(model);
  options.sigma_px = 1;
  const auto of_point = [](int32_t k) {
    return KnownPosition{KnownPosition::Of::kPoint3D, k,
                         BallAround(Eigen::Vector3d::Zero(), 1)};
  };
  options.positions = {of_point(1), of_point(2), of_point(3)};
  EXPECT_EQ(AdjustBundle(model, options, kAdjustAlone).summary.num_positions,
            1);
  options.positions.push_back(of_point(3));
  EXPECT_THROW(AdjustBundle(model, options, kAdjustAlone),
               std::invalid_argument);
}

TEST(AdjustBundle, LeavesTheBitsOfWhatIsFixedAndMovesTheRest) {
  for (const bool is_bounded : {false, true}) {
    SceneOptions scene = SmallOptions();
    scene.sensors_per_rig = 2;
    const Model model = SynthesizeScene(scene).model;
    BundleAdjustmentOptions options = Exact();
    options.fixed = SomeFixed(model);
    if (is_bounded) {
      options.max_error = 1.05 * Summarize(PixelErrors(model, 1)).max;
    }
    const BundleAdjustmentResult result =
        AdjustBundle(model, options, kAdjustAlone);
    EXPECT_LT(*result.summary.stationarity, 1e-5);
    EXPECT_LT(CostOf(result.model), 0.9 * CostOf(model));
    Model put_back = model;
    put_back.cameras = result.model.cameras;
    for (size_t f = 0; f < model.frames.size(); ++f) {
      if (options.fixed.frames[f]) continue;
      EXPECT_NE(result.model.frames[f].rig_from_world.translation,
                model.frames[f].rig_from_world.translation);
      put_back.frames[f] = result.model.frames[f];
      for (const FrameData& data : model.frames[f].data) {
        for (size_t n = 0; n < model.images.size(); ++n) {
          if (model.images[n].id == data.data_id) {
            put_back.images[n] = result.model.images[n];
          }
        }
      }
    }
    for (size_t k = 0; k < model.points3D.size(); ++k) {
      if (options.fixed.points3D[k]) continue;
      EXPECT_NE(result.model.points3D[k].xyz, model.points3D[k].xyz);
      put_back.points3D[k].xyz = result.model.points3D[k].xyz;
    }
    EXPECT_EQ(ModelComparison({}).FirstDifference(put_back, result.model), "");
  }
}

TEST(AdjustBundle, WithARobustLossEndsWhereAnIndependentProblemDoes) {
  SceneOptions scene = SmallOptions();
  scene.outlier_ratio = 0.02;
  const Model model = SynthesizeScene(scene).model;
  BundleAdjustmentOptions options = RotationsFixed();
  options.max_num_iterations = 300;
  const auto expect_same = [&](RobustLoss kind, ceres::LossFunction* loss) {
    options.loss = kind;
    options.loss_scale = 2;
    const double expected = IndependentFixedRotationCost(model, loss);
    EXPECT_NEAR(AdjustBundle(model, options, kAdjustAlone).summary.cost_final,
                expected, 1e-4 * expected);
  };
  ceres::HuberLoss huber(2);
  ceres::SoftLOneLoss soft_l1(2);
  expect_same(RobustLoss::kHuber, &huber);
  expect_same(RobustLoss::kSoftL1, &soft_l1);
}

TEST(AdjustBundle, WithCauchysLossFindsWhatADistantStartHides) {
  SceneOptions scene = SmallOptions();
  scene.rotation_noise_deg = 3;
  scene.start_translation_noise = 0.1;
  scene.start_point_noise = 0.1;
  const Model model = SynthesizeScene(scene).model;
  BundleAdjustmentOptions options = RotationsFixed();
  options.max_num_iterations = 300;
  options.loss = RobustLoss::kCauchy;
  ceres::CauchyLoss loss(options.loss_scale);
  const double from_the_start = IndependentFixedRotationCost(model, &loss);
  const BundleAdjustmentSummary summary =
      AdjustBundle(model, options, kAdjustAlone).summary;
  EXPECT_LT(summary.cost_final, 0.98 * from_the_start);
  EXPECT_THAT(summary.first_loss_scale,
              testing::Optional(testing::DoubleNear(
                  LowerMedian(PixelErrors(model, 1)), 1e-6)));
  EXPECT_EQ(summary.iterations.size(), summary.num_iterations);
}

// Where wrong observations draw cameras away as long as the loss is wide.
TEST(AdjustBundle, WithCauchysLossEndsNoHigherThanWithoutAWiderOne) {
  SceneOptions scene = SceneOf(12, 180, 3, 0.5, 2);
  scene.layout = SceneLayout::kStreet;
  scene.camera_model_id = 1;
  scene.outlier_ratio = 0.1;
  scene.rotation_noise_deg = 3;
  scene.start_translation_noise = 0.02;
  scene.start_point_noise = 0.02;
  const SyntheticScene street = SynthesizeScene(scene);
  BundleAdjustmentOptions options;
  options.loss = RobustLoss::kCauchy;
  const auto adjust = [&](const Model& model) {
    return AdjustBundle(model, options, kAdjustAlone).summary;
  };
  EXPECT_GT(Median(PixelErrors(street.model, 1)), options.loss_scale);
  EXPECT_LT(adjust(street.model).cost_final,
            1.01 * adjust(street.ground_truth).cost_final);
}

// Two of five observations of a frame are those of another pose, at which it
// starts: there they fit, and the narrow loss hardly feels the others.
TEST(AdjustBundle, WithCauchysLossMovesAFrameToWhereMostOfItFits) {
  Model model = SynthesizeScene(SceneOf(12, 400, 6, 0.5, 3)).ground_truth;
  constexpr size_t kFrame = 3;
  const Model truth = model;
  Pose& pose = model.frames[kFrame].rig_from_world;
  const Eigen::AngleAxisd turn(0.1, Eigen::Vector3d(1, 2, 3).normalized());
  const RigidTransform turned =
      RigidTransform{turn.toRotationMatrix(), {0, 0, 0}} * pose.Transform();
  Model true_start = model;
  int64_t num_seen = 0;
  for (const Point3D& point : truth.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = truth.track_elements[e];
      if (element.image_id != truth.images[kFrame].id) continue;
      if (num_seen++ % 5 >= 2) continue;
      const Eigen::Vector2d pixel =
          *ProjectPoint(truth.cameras[0], turned * point.xyz);
      Point2D& seen = true_start.images[kFrame].points2D[element.point2D_idx];
      seen.x = pixel.x();
      seen.y = pixel.y();
    }
  }
  model.images = true_start.images;
  pose = ToPose(turned);
  FollowFrames(&model);
  BundleAdjustmentOptions options;
  options.loss = RobustLoss::kCauchy;
  const BundleAdjustmentSummary expected =
      AdjustBundle(true_start, options, kAdjustAlone).summary;
  const BundleAdjustmentSummary summary =
      AdjustBundle(model, options, kAdjustAlone).summary;
  EXPECT_EQ(expected.num_moved_frames, 0);
  EXPECT_EQ(summary.num_moved_frames, 1);
  // Some points stay near what the wrong pose saw.
  EXPECT_LT(summary.cost_final, 1.02 * expected.cost_final);
  EXPECT_EQ(summary.iterations.size(), summary.num_iterations);
}

TEST(AdjustBundle, FindsExactModelsOfEveryCamera) {
  for (int id = 0; id < 17; ++id) {
    SCOPED_TRACE(id);
    SceneOptions scene = SmallOptions();
    scene.camera_model_id = id;
    scene.sensors_per_rig = 2;
    scene.pixel_noise = 0;
    const Model model = SynthesizeScene(scene).model;
    EXPECT_GT(CostOf(model), 10);
    const BundleAdjustmentResult result =
        AdjustBundle(model, Exact(), kAdjustAlone);
    EXPECT_LT(CostOf(result.model), 1e-6);
    ValidateModel(result.model);
  }
}

TEST(AdjustBundle, LeavesTheBitsOfWhatIsHeldStill) {
  SceneOptions scene = SmallOptions();
  scene.sensors_per_rig = 2;
  const Model model = SynthesizeScene(scene).model;
  BundleAdjustmentOptions options = Exact();
  options.refine_rig_from_world = false;
  options.refine_sensor_from_rig = false;
  options.refine_focal_length = false;
  options.refine_extra_params = false;
  const Model points_only = AdjustBundle(model, options, kAdjustAlone).model;
  EXPECT_LT(CostOf(points_only), CostOf(model));
  Ignoring ignoring;
  ignoring.coordinates = true;
  EXPECT_EQ(ModelComparison(ignoring).FirstDifference(model, points_only), "");

  options.refine_points3D = false;
  const BundleAdjustmentResult nothing =
      AdjustBundle(model, options, kAdjustAlone);
  EXPECT_EQ(nothing.summary.termination,
            BundleAdjustmentTermination::kNothingToAdjust);
  EXPECT_EQ(ModelComparison({}).FirstDifference(model, nothing.model), "");
}

TEST(AdjustBundle, RefinesOneGroupOfIntrinsicsAtATime) {
  const Model model = SynthesizeScene(SmallOptions()).model;
  for (int group = 0; group < 3; ++group) {
    BundleAdjustmentOptions options = Exact();
    options.refine_focal_length = group == 0;
    options.refine_principal_point = group == 1;
    options.refine_extra_params = group == 2;
    const std::vector<double> before = model.cameras[0].params;
    const std::vector<double> after =
        AdjustBundle(model, options, kAdjustAlone).model.cameras[0].params;
    // SIMPLE_RADIAL: f, cx, cy, k
    const std::vector<bool> may_move = {group == 0, group == 1, group == 1,
                                        group == 2};
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(after[i] != before[i], may_move[i]) << group << ", " << i;
    }
  }
}

TEST(AdjustBundle, LeavesShortTracksAndEmptyImagesWhereTheyAre) {
  Model model = SynthesizeScene(SmallOptions()).model;
  // The first point keeps one observation.
  Point3D& point = model.points3D[0];
  for (uint64_t e = point.track_begin + 1; e < point.track_end; ++e) {
    const TrackElement& element = model.track_elements[e];
    for (Image& image : model.images) {
      if (image.id != element.image_id) continue;
      image.points2D[element.point2D_idx].point3D_id = kInvalidPoint3DId;
    }
  }
  const uint64_t removed = point.track_end - point.track_begin - 1;
  model.track_elements.erase(
      model.track_elements.begin() + point.track_begin + 1,
      model.track_elements.begin() + point.track_end);
  point.track_end -= removed;
  for (size_t k = 1; k < model.points3D.size(); ++k) {
    model.points3D[k].track_begin -= removed;
    model.points3D[k].track_end -= removed;
  }
  ValidateModel(model);
  const BundleAdjustmentResult result =
      AdjustBundle(model, Exact(), kAdjustAlone);
  EXPECT_EQ(result.summary.num_short_track, 1);
  EXPECT_EQ(result.model.points3D[0].xyz, model.points3D[0].xyz);
  EXPECT_EQ(result.model.points3D.size(), model.points3D.size());
}

TEST(AdjustBundle, LeavesOutWhatIsBehindItsCamera) {
  Model model = SynthesizeScene(SmallOptions()).model;
  model.points3D[0].xyz *= -1e3;
  const int64_t num_behind =
      static_cast<int64_t>(Summarize(PixelErrors(model, 1)).not_finite);
  ASSERT_GT(num_behind, 0);
  EXPECT_EQ(AdjustBundle(model, Exact(), kAdjustAlone).summary.num_behind,
            num_behind);
}

TEST(AdjustBundle, EndsNoWorseWhereAPointLiesNextToACamera) {
  Model model = SynthesizeScene(SmallOptions()).model;
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  const auto image_of = ImageIndices(model);
  Point3D& point = model.points3D[0];
  const TrackElement& first = model.track_elements[point.track_begin];
  const RigidTransform& pose =
      images[image_of.at(first.image_id)].cam_from_world;
  point.xyz = Center(pose) + 1e-12 * pose.rotation.row(2).transpose();
  // All others see it where it lies.
  for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
    const TrackElement& element = model.track_elements[e];
    const int32_t n = image_of.at(element.image_id);
    const Eigen::Vector3d x_cam = images[n].cam_from_world * point.xyz;
    const Eigen::Vector2d pixel =
        ProjectRay(model.cameras[images[n].camera], x_cam.hnormalized());
    Point2D& point2D = model.images[n].points2D[element.point2D_idx];
    point2D.x = pixel.x();
    point2D.y = pixel.y();
  }
  const double cost = CostOf(model);
  BundleAdjustmentOptions options;
  options.max_num_iterations = 0;
  EXPECT_NEAR(CostOf(AdjustBundle(model, options, kAdjustAlone).model), cost,
              1e-9 * cost);
  options.max_num_iterations = 3;
  EXPECT_LT(CostOf(AdjustBundle(model, options, kAdjustAlone).model), cost);
}

TEST(AdjustBundle, GivesTheSameBitsAgainOnOneThread) {
  const Model model = SynthesizeScene(SmallOptions()).model;
  const Model a = AdjustBundle(model, Exact(), kAdjustAlone).model;
  const Model b = AdjustBundle(model, Exact(), kAdjustAlone).model;
  EXPECT_EQ(ModelComparison({}).FirstDifference(a, b), "");
}

TEST(AdjustBundle, ReachesTheSameCostWithEveryLinearSolver) {
  SceneOptions scene = SmallOptions();
  scene.layout = SceneLayout::kStreet;
  scene.num_frames = 30;
  scene.num_points = 300;
  scene.track_length = 3;
  const Model model = SynthesizeScene(scene).model;
  BundleAdjustmentOptions options = Exact();
  const BundleAdjustmentSummary dense =
      AdjustBundle(model, options, kAdjustAlone).summary;
  EXPECT_EQ(dense.linear_solver, "dense_schur");
  options.max_num_images_direct_dense = 0;
  const BundleAdjustmentSummary sparse =
      AdjustBundle(model, options, kAdjustAlone).summary;
  EXPECT_EQ(sparse.linear_solver, "sparse_schur");
  options.max_num_images_direct_sparse = 0;
  const BundleAdjustmentSummary iterative =
      AdjustBundle(model, options, kAdjustAlone).summary;
  EXPECT_EQ(iterative.linear_solver, "iterative_schur");
  EXPECT_NEAR(sparse.cost_final, dense.cost_final, 1e-7 * dense.cost_final);
  EXPECT_NEAR(iterative.cost_final, dense.cost_final, 1e-5 * dense.cost_final);
}

TEST(AdjustBundle, SolvesADenseSystemWhereASparseFactorWouldBeFull) {
  const Model model = SynthesizeScene(SmallOptions()).model;
  BundleAdjustmentOptions options = Exact();
  options.max_num_images_direct_dense = 0;
  const BundleAdjustmentSummary summary =
      AdjustBundle(model, options, kAdjustAlone).summary;
  EXPECT_EQ(summary.linear_solver, "dense_schur");
}

Model Enlarged(Model model, double factor) {
  for (Point3D& point : model.points3D) point.xyz *= factor;
  for (Frame& frame : model.frames) frame.rig_from_world.translation *= factor;
  for (Image& image : model.images) image.cam_from_world.translation *= factor;
  return model;
}

TEST(AdjustBundle, DoesNotDependOnTheUnitOfLength) {
  const Model model = SynthesizeScene(SmallOptions()).model;
  const BundleAdjustmentResult result =
      AdjustBundle(model, Exact(), kAdjustAlone);
  for (const double factor : {std::exp2(-30), std::exp2(30)}) {
    SCOPED_TRACE(factor);
    const BundleAdjustmentResult other =
        AdjustBundle(Enlarged(model, factor), Exact(), kAdjustAlone);
    EXPECT_EQ(other.summary.num_iterations, result.summary.num_iterations);
    EXPECT_EQ(ModelComparison({}).FirstDifference(
                  other.model, Enlarged(result.model, factor)),
              "");
  }
}

TEST(AdjustBundle, StopsWhenCancelled) {
  const Model model = SynthesizeScene(SmallOptions()).model;
  BundleAdjustmentOptions options = Exact();
  CancelFlag cancel{false};
  int num_calls = 0;
  options.callback = [&](const BundleAdjustmentIteration&) {
    if (++num_calls == 2) cancel = true;
  };
  const BundleAdjustmentResult result =
      AdjustBundle(model, options, {1, &cancel});
  EXPECT_EQ(result.summary.termination,
            BundleAdjustmentTermination::kInterrupted);
  EXPECT_EQ(num_calls, 2);
  EXPECT_LT(CostOf(result.model), CostOf(model));
}

TEST(AdjustBundle, RefusesOptionsOutOfRangeByName) {
  const Model model = SynthesizeScene(SmallOptions()).model;
  using Options = BundleAdjustmentOptions;
  const auto message = [&](const auto& set) -> std::string {
    Options options;
    set(&options);
    return MessageOf<std::invalid_argument>(
        [&] { AdjustBundle(model, options); });
  };
  for (const auto& [name, member] :
       {std::pair("min_track_length", &Options::min_track_length),
        std::pair("max_linear_solver_iterations",
                  &Options::max_linear_solver_iterations)}) {
    EXPECT_EQ(message([m = member](Options* options) { options->*m = 0; }),
              std::string(name) + " = 0, must be >= 1");
  }
  for (const auto& [name, member] :
       {std::pair("max_num_iterations", &Options::max_num_iterations),
        std::pair("max_num_images_direct_dense",
                  &Options::max_num_images_direct_dense),
        std::pair("max_num_images_direct_sparse",
                  &Options::max_num_images_direct_sparse)}) {
    EXPECT_EQ(message([m = member](Options* options) { options->*m = -1; }),
              std::string(name) + " = -1, must be >= 0");
  }
  for (const auto& [name, member] :
       {std::pair("function_tolerance", &Options::function_tolerance),
        std::pair("gradient_tolerance", &Options::gradient_tolerance),
        std::pair("parameter_tolerance", &Options::parameter_tolerance)}) {
    for (const double value : {-1.0, std::nan("")}) {
      EXPECT_THAT(
          message([&, m = member](Options* options) { options->*m = value; }),
          testing::AllOf(testing::StartsWith(name),
                         testing::EndsWith(", must be >= 0")));
    }
  }
  EXPECT_EQ(message([](Options* options) { options->loss_scale = 0; }),
            "loss_scale = 0, must be > 0");
  EXPECT_EQ(message([](Options* options) { options->max_error = 0; }),
            "max_error = 0, must be > 0");
  EXPECT_THAT(message([](Options* options) {
                options->max_error = 3;
                options->loss = RobustLoss::kHuber;
              }),
              testing::HasSubstr("trivial with a cap"));
}

TEST(AdjustBundle, RefusesPanoramas) {
  Model model = SynthesizeScene(SmallOptions()).model;
  model.cameras[0].model_id = 17;
  model.cameras[0].params = {1024, 512};
  EXPECT_THROW(AdjustBundle(model, {}, kAdjustAlone), ModelError);
}

}  // namespace
}  // namespace krot::internal
