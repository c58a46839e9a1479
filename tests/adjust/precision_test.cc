#include "krot/adjust/bundle_adjustment.h"

#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/adjust/precision_system.h"
#include "krot/geometry.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/synthetic/scene.h"
#include "tests/oracle/dense_algebra.h"
#include "tests/testing/scene_of.h"

// The oracle knows no derivative, eliminates nothing and has no formula of a
// gauge: central differences of all errors, and of what the datum holds, by all
// unknowns; the gauge is where singular values vanish; and the covariance is a
// block of the inverse of the bordered normal equations
//
//   [ J'J  B ]^-1
//   [ B'   0 ]

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

Model PreciseScene(int camera_model_id, int sensors_per_rig = 2) {
  SceneOptions options = SceneOf(4, 25, sensors_per_rig == 1 ? 3.5 : 5, 1, 5);
  options.camera_model_id = camera_model_id;
  options.sensors_per_rig = sensors_per_rig;
  return SynthesizeScene(options).ground_truth;
}

// What was moved, as numbers.
using Functional = std::function<VectorXd(const AdjustmentBlocks&)>;

VectorXd StackedErrors(const AdjustmentBlocks& blocks) {
  std::vector<double> stacked;
  const auto add = [&](const auto& error) {
    stacked.insert(stacked.end(), error.data(), error.data() + error.size());
  };
  const auto errors = ProjectErrors(blocks, 1e300, 1);
  for (const ProjectedError& error : *errors) add(error.r);
  for (const PositionObservation& position : blocks.positions) {
    add(Vector3d(position.px_from_world *
                 (PositionOf(position.of, blocks) - position.position)));
  }
  for (const DistanceObservation& distance : blocks.distances) {
    if (distance.px_from_world == 0) continue;
    stacked.push_back(ErrorPx(distance, blocks));
  }
  return VectorXd::Map(stacked.data(), static_cast<Index>(stacked.size()));
}

// By all unknowns, points first.
MatrixXd Differentiate(const AdjustmentColumns& columns,
                       const AdjustmentBlocks& blocks,
                       const Functional& functional) {
  constexpr double kStep = 1e-6;
  std::vector<VectorXd> derivatives;
  BlockVector direction;
  direction.SetZero(static_cast<int64_t>(blocks.points.size()),
                    columns.num_blocks);
  const auto at = [&](double step) {
    AdjustmentBlocks moved = blocks;
    MoveAlong(columns, blocks, direction, step, &moved);
    return functional(moved);
  };
  for (auto* list : {&direction.points, &direction.frames}) {
    for (Vector3d& unknown : *list) {
      for (int c = 0; c < 3; ++c) {
        unknown[c] = 1;
        derivatives.push_back((at(kStep) - at(-kStep)) / (2 * kStep));
        unknown[c] = 0;
      }
    }
  }
  MatrixXd J(derivatives[0].size(), static_cast<Index>(derivatives.size()));
  for (size_t n = 0; n < derivatives.size(); ++n) {
    J.col(static_cast<Index>(n)) = derivatives[n];
  }
  return J;
}

Vector3d CentreOf(const PoseBlock& frame) {
  return Center({RotationOf(frame), TranslationOf(frame)});
}

VectorXd HeldByCameras(const AdjustmentBlocks& truth,
                       const AdjustmentBlocks& blocks) {
  VectorXd held = VectorXd::Zero(7);
  Vector3d mean = Vector3d::Zero();
  for (const PoseBlock& frame : blocks.frames) {
    mean += CentreOf(frame) / static_cast<double>(blocks.frames.size());
  }
  for (size_t f = 0; f < blocks.frames.size(); ++f) {
    held[6] += (CentreOf(blocks.frames[f]) - mean).squaredNorm();
    const Eigen::AngleAxisd turn(RotationOf(truth.frames[f]).transpose() *
                                 RotationOf(blocks.frames[f]));
    held.segment<3>(3) += turn.angle() * turn.axis();
  }
  held.head<3>() = mean;
  return held;
}

VectorXd HeldByPoints(const AdjustmentBlocks& truth,
                      const AdjustmentBlocks& blocks) {
  VectorXd held = VectorXd::Zero(7);
  for (size_t k = 0; k < blocks.points.size(); ++k) {
    held.head<3>() += blocks.points[k];
    held.segment<3>(3) += truth.points[k].cross(blocks.points[k]);
    held[6] += truth.points[k].dot(blocks.points[k]);
  }
  return held;
}

// Of the frame that is farthest from the first.
VectorXd HeldByFirst(const AdjustmentBlocks& truth,
                     const AdjustmentBlocks& blocks) {
  VectorXd held(7);
  const Eigen::AngleAxisd turn(RotationOf(truth.frames[0]).transpose() *
                               RotationOf(blocks.frames[0]));
  held << CentreOf(blocks.frames[0]), turn.angle() * turn.axis(), 0;
  double longest = 0;
  for (size_t f = 1; f < blocks.frames.size(); ++f) {
    const Vector3d base = CentreOf(truth.frames[f]) - CentreOf(truth.frames[0]);
    if (base.norm() < longest) continue;
    longest = base.norm();
    Index coordinate = 0;
    base.cwiseAbs().maxCoeff(&coordinate);
    held[6] = CentreOf(blocks.frames[f])[coordinate];
  }
  return held;
}

// Rotation about the camera's axes and centre of an image, from its pose in the
// model as it stands.
Functional PoseOf(const Model& model, const AdjustmentBlocks& truth,
                  int32_t image) {
  return [&model, &truth, image](const AdjustmentBlocks& blocks) {
    const auto before = ImageGeometries(model)[image].cam_from_world;
    const auto after = ImageGeometries(ApplyBlocks(model, truth, blocks))[image]
                           .cam_from_world;
    const Eigen::AngleAxisd turn(after.rotation * before.rotation.transpose());
    VectorXd pose(6);
    pose << turn.angle() * turn.axis(), Center(after);
    return pose;
  };
}

struct DenseOracle {
  DenseOracle(const Model& model, const BundleAdjustmentOptions& options,
              AdjustmentDatum datum)
      : blocks(MakeAdjustmentBlocks(model, 2, options.fixed)),
        columns(options, blocks) {
    AddSurvey(model, options, &columns, &blocks);
    const MatrixXd J = Differentiate(columns, blocks, StackedErrors);
    const VectorXd norms = J.colwise().norm();
    std::vector<Index> moving;
    for (Index n = 0; n < norms.size(); ++n) {
      if (norms[n] > 0) moving.push_back(n);
    }
    const auto pick = [&](const MatrixXd& all) {
      MatrixXd picked(all.rows(), static_cast<Index>(moving.size()));
      for (size_t n = 0; n < moving.size(); ++n) {
        picked.col(static_cast<Index>(n)) =
            all.col(moving[n]) / norms[moving[n]];
      }
      return picked;
    };
    const MatrixXd scaled = pick(J);
    // The eigenvalues are those of J, of both signs, and zeros; R projects
    // onto what belongs to the zeros.
    MatrixXd both =
        MatrixXd::Zero(J.rows() + scaled.cols(), J.rows() + scaled.cols());
    both.topRightCorner(J.rows(), scaled.cols()) = scaled;
    both.bottomLeftCorner(scaled.cols(), J.rows()) = scaled.transpose();
    const SymmetricEigen eigen = EigenOfSymmetric(both);
    const Index rank = (eigen.values.array() > 1e-7).count();
    redundancy = J.rows() - rank;
    const MatrixXd none = eigen.vectors.topRows(J.rows()).middleCols(
        rank, eigen.values.size() - 2 * rank);
    R = none * none.transpose();
    sigma0 = std::sqrt(StackedErrors(blocks).squaredNorm() /
                       static_cast<double>(redundancy));
    const Functional held = [&](const AdjustmentBlocks& moved) {
      return datum == AdjustmentDatum::kPoints    ? HeldByPoints(blocks, moved)
             : datum == AdjustmentDatum::kCameras ? HeldByCameras(blocks, moved)
                                                  : HeldByFirst(blocks, moved);
    };
    const Index size = scaled.cols();
    defect = size - rank;
    // What the datum holds: all but the scale where distances give that, and
    // nothing where more is known or fixed.
    const MatrixXd B = pick(Differentiate(columns, blocks, held))
                           .transpose()
                           .leftCols(defect < 6 ? 0 : defect);
    MatrixXd bordered = MatrixXd::Zero(size + B.cols(), size + B.cols());
    bordered.topLeftCorner(size, size) = scaled.transpose() * scaled;
    bordered.topRightCorner(size, B.cols()) = B;
    bordered.bottomLeftCorner(B.cols(), size) = B.transpose();
    const MatrixXd inverse =
        SolveByLu(bordered,
                  MatrixXd::Identity(bordered.rows(), bordered.cols()))
            .topLeftCorner(size, size);
    C = MatrixXd::Zero(J.cols(), J.cols());
    for (size_t a = 0; a < moving.size(); ++a) {
      for (size_t b = 0; b < moving.size(); ++b) {
        C(moving[a], moving[b]) =
            inverse(static_cast<Index>(a), static_cast<Index>(b)) /
            (norms[moving[a]] * norms[moving[b]]);
      }
    }
    C *= sigma0 * sigma0;
  }

  MatrixXd CovarianceOf(const Functional& functional) const {
    const MatrixXd J = Differentiate(columns, blocks, functional);
    return J * C * J.transpose();
  }

  AdjustmentBlocks blocks;
  AdjustmentColumns columns;
  MatrixXd R, C;
  Index redundancy = 0, defect = 0;
  double sigma0 = 0;
};

AdjustmentPrecision PrecisionOf(const Model& model,
                                const BundleAdjustmentOptions& options,
                                AdjustmentDatum datum) {
  const AdjustmentBlocks blocks =
      MakeAdjustmentBlocks(model, options.min_track_length, options.fixed);
  return FindPrecision(model, options, blocks, datum, {});
}

void ExpectNear(const MatrixXd& actual, const MatrixXd& expected) {
  EXPECT_LT((actual - expected).norm(), 1e-4 * expected.norm() + 1e-12);
}

void ExpectByDefinition(const Model& model,
                        const BundleAdjustmentOptions& options,
                        AdjustmentDatum datum) {
  const DenseOracle oracle(model, options, datum);
  const AdjustmentPrecision precision = PrecisionOf(model, options, datum);
  EXPECT_EQ(precision.redundancy, oracle.redundancy);
  EXPECT_EQ(precision.datum_defect + precision.num_undetermined, oracle.defect);
  EXPECT_NEAR(precision.sigma0_px, oracle.sigma0, 1e-9 * oracle.sigma0);
  ASSERT_TRUE(precision.has_covariances);
  double sum = 0;
  for (size_t i = 0; i < precision.observations.size(); ++i) {
    for (int c = 0; c < 2; ++c) {
      const auto row = static_cast<Index>(2 * i) + c;
      EXPECT_NEAR(precision.observations[i].redundancy[c], oracle.R(row, row),
                  1e-4);
      sum += precision.observations[i].redundancy[c];
    }
  }
  EXPECT_NEAR(sum,
              oracle.R.diagonal().head(2 * precision.observations.size()).sum(),
              1e-6 * sum);
  for (const PointPrecision& point : precision.points) {
    const Index first = 3 * point.point;
    ExpectNear(point.sigma.cwiseAbs2(), oracle.C.diagonal().segment<3>(first));
  }
  for (const ImagePrecision& image : precision.images) {
    ASSERT_TRUE(image.covariance);
    ExpectNear(*image.covariance,
               oracle.CovarianceOf(PoseOf(model, oracle.blocks, image.image)));
  }
  for (const CameraPrecision& camera : precision.cameras) {
    ASSERT_TRUE(camera.covariance);
    ExpectNear(*camera.covariance,
               oracle.CovarianceOf([&](const AdjustmentBlocks& blocks) {
                 VectorXd params(static_cast<Index>(camera.params.size()));
                 for (size_t n = 0; n < camera.params.size(); ++n) {
                   params[static_cast<Index>(n)] =
                       blocks.cameras[camera.camera][camera.params[n]];
                 }
                 return params;
               }));
  }
  ASSERT_EQ(precision.distances.size(), options.distances.size());
  Index row = oracle.R.rows() - precision.num_distances;
  for (size_t n = 0; n < precision.distances.size(); ++n) {
    const DistancePrecision& distance = precision.distances[n];
    const DistanceObservation& of = oracle.blocks.distances[n];
    const MatrixXd variance =
        oracle.CovarianceOf([&](const AdjustmentBlocks& blocks) {
          return VectorXd::Constant(1, LengthOf(of, blocks));
        });
    EXPECT_NEAR(distance.sigma, std::sqrt(variance(0, 0)),
                1e-4 * distance.sigma);
    if (!options.distances[n].metres) continue;
    const double r = oracle.R(row, row);
    ++row;
    EXPECT_NEAR(distance.redundancy, r, 1e-4);
    EXPECT_NEAR(distance.w,
                ErrorPx(of, oracle.blocks) / (oracle.sigma0 * std::sqrt(r)),
                1e-3 * std::abs(distance.w));
  }
}

class PrecisionInDatum : public ::testing::TestWithParam<AdjustmentDatum> {};

TEST_P(PrecisionInDatum, IsByItsDefinitionWhateverMoves) {
  BundleAdjustmentOptions options;
  ExpectByDefinition(PreciseScene(2, 1), options, GetParam());
  ExpectByDefinition(PreciseScene(4), options, GetParam());
  options.refine_focal_length = false;
  options.refine_extra_params = false;
  ExpectByDefinition(PreciseScene(5, 1), options, GetParam());
}

INSTANTIATE_TEST_SUITE_P(Datum, PrecisionInDatum,
                         ::testing::Values(AdjustmentDatum::kCameras,
                                           AdjustmentDatum::kPoints,
                                           AdjustmentDatum::kFirstCamera));

TEST(Precision, IsByItsDefinitionWherePartsAreFixed) {
  const Model model = PreciseScene(2, 1);
  BundleAdjustmentOptions options;
  options.fixed.frames = {1, 0, 1, 0};
  ExpectByDefinition(model, options, AdjustmentDatum::kCameras);
  options.fixed.frames.clear();
  options.fixed.points3D.assign(model.points3D.size(), 0);
  for (int k = 0; k < 3; ++k) options.fixed.points3D[k] = 1;
  ExpectByDefinition(model, options, AdjustmentDatum::kPoints);
  const AdjustmentPrecision precision =
      PrecisionOf(model, options, AdjustmentDatum::kPoints);
  EXPECT_EQ(precision.datum_defect, 0);
  EXPECT_TRUE(precision.points[0].sigma.isZero(0));
}

// Of a camera, through its rig, and of a point: an ellipsoid askew and a ball,
// each a little off.
std::vector<KnownPosition> SomePositions(const Model& model, int num_images,
                                         int num_points) {
  std::vector<KnownPosition> positions;
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  for (int n = 0; n < num_images; ++n) {
    const int32_t image = 2 * n + 1;
    const Vector3d off(0.001, 0.002 * n, -0.001);
    positions.push_back(
        {KnownPosition::Of::kImage,
         image,
         {Center(images[image].cam_from_world) + off,
          {0.01, 0.02, 0.03},
          Eigen::Quaterniond(Eigen::AngleAxisd(1, off.normalized()))}});
  }
  for (int32_t k = 0; k < num_points; ++k) {
    positions.push_back(
        {KnownPosition::Of::kPoint3D, k,
         BallAround(model.points3D[k].xyz + Vector3d(0, 0.001, 0), 0.02)});
  }
  return positions;
}

TEST(Precision, IsByItsDefinitionWherePositionsAreKnown) {
  const Model in_rigs = PreciseScene(2);
  const Model alone = PreciseScene(2, 1);
  BundleAdjustmentOptions options;
  options.sigma_px = 1;
  for (const auto& [num_images, num_points] :
       {std::pair(2, 2), std::pair(0, 3), std::pair(2, 1)}) {
    for (const Model* model : {&in_rigs, &alone}) {
      options.positions = SomePositions(*model, num_images, num_points);
      ExpectByDefinition(*model, options, AdjustmentDatum::kCameras);
      EXPECT_EQ(
          PrecisionOf(*model, options, AdjustmentDatum::kCameras).datum_defect,
          0);
    }
  }
}

TEST(Precision, CountsTheGaugeThatKnownPositionsLeave) {
  const Model model = PreciseScene(2, 1);
  const auto defect = [&](int num_images, int num_points) {
    BundleAdjustmentOptions options;
    options.sigma_px = 1;
    options.positions = SomePositions(model, num_images, num_points);
    return PrecisionOf(model, options, AdjustmentDatum::kCameras).datum_defect;
  };
  EXPECT_EQ(defect(0, 0), 7);
  EXPECT_EQ(defect(0, 1), 4);  // turns about the point, and the scale
  EXPECT_EQ(defect(1, 1), 1);  // turns about the line
  EXPECT_EQ(defect(1, 2), 0);
}

KnownDistance::End Camera(int32_t image) { return {true, image}; }
KnownDistance::End Point(int32_t point) { return {false, point}; }

// A per cent too long, to within three.
std::vector<KnownDistance> SomeDistances(
    const Model& model,
    const std::vector<std::array<KnownDistance::End, 2>>& ends) {
  std::vector<KnownDistance> distances;
  for (const auto& pair : ends) distances.push_back({pair, {}, 0});
  const std::vector<double> lengths = LengthsOf(model, distances);
  for (size_t n = 0; n < ends.size(); ++n) {
    distances[n].metres = 1.01 * lengths[n];
    distances[n].tolerance = 0.03 * lengths[n];
  }
  return distances;
}

// Between points, which share one, between cameras, in one rig and in two, and
// from a camera to a point; the last length is only asked for.
TEST(Precision, IsByItsDefinitionWhereDistancesAreKnown) {
  BundleAdjustmentOptions options;
  options.sigma_px = 1;
  for (const int sensors_per_rig : {1, 2}) {
    const Model model = PreciseScene(2, sensors_per_rig);
    options.distances = SomeDistances(model, {{Point(0), Point(3)},
                                              {Point(3), Point(9)},
                                              {Camera(0), Camera(1)},
                                              {Camera(3), Camera(0)},
                                              {Camera(2), Point(5)},
                                              {Point(1), Point(2)}});
    options.distances.back().metres.reset();
    for (const AdjustmentDatum datum :
         {AdjustmentDatum::kCameras, AdjustmentDatum::kPoints}) {
      ExpectByDefinition(model, options, datum);
      EXPECT_EQ(PrecisionOf(model, options, datum).datum_defect, 6);
    }
    options.positions = SomePositions(model, 1, 4);
    ExpectByDefinition(model, options, AdjustmentDatum::kCameras);
    options.positions.clear();
  }
}

// Lengths that are only asked for leave the scale free.
TEST(Precision, OfALengthIsThatOfItsDatum) {
  const Model model = PreciseScene(2, 1);
  BundleAdjustmentOptions options;
  options.sigma_px = 1;
  options.distances =
      SomeDistances(model, {{Point(0), Point(3)}, {Camera(0), Point(3)}});
  for (KnownDistance& distance : options.distances) distance.metres.reset();
  for (const AdjustmentDatum datum :
       {AdjustmentDatum::kCameras, AdjustmentDatum::kPoints,
        AdjustmentDatum::kFirstCamera}) {
    ExpectByDefinition(model, options, datum);
    EXPECT_EQ(PrecisionOf(model, options, datum).datum_defect, 7);
  }
}

TEST(Precision, CountsTheGaugeThatFixedPartsLeave) {
  const Model model = PreciseScene(2, 1);
  BundleAdjustmentOptions options;
  const auto defect = [&] {
    return PrecisionOf(model, options, AdjustmentDatum::kCameras).datum_defect;
  };
  EXPECT_EQ(defect(), 7);
  options.constant_rig_from_world_rotation = true;
  EXPECT_EQ(defect(), 4);
  options.constant_rig_from_world_rotation = false;
  options.fixed.frames = {1, 0, 0, 0};
  EXPECT_EQ(defect(), 1);  // the scale
  options.fixed.frames.clear();
  options.fixed.points3D.assign(model.points3D.size(), 0);
  options.fixed.points3D[3] = 1;
  EXPECT_EQ(defect(), 4);  // turns about the point, and the scale
  options.fixed.points3D[5] = 1;
  EXPECT_EQ(defect(), 1);  // turns about the line
}

// All observations of image 0 go but for those of two points.
TEST(Precision, SaysWhichImageIsNotDetermined) {
  Model model = PreciseScene(2, 1);
  const ImageId lone = model.images[0].id;
  std::vector<TrackElement> elements;
  int num_kept = 0;
  for (Point3D& point : model.points3D) {
    const auto begin = elements.size();
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model.track_elements[e];
      if (element.image_id == lone && ++num_kept > 2) continue;
      elements.push_back(element);
    }
    point.track_begin = begin;
    point.track_end = elements.size();
  }
  model.track_elements = elements;
  const DenseOracle oracle(model, {}, AdjustmentDatum::kPoints);
  const AdjustmentPrecision precision =
      PrecisionOf(model, {}, AdjustmentDatum::kPoints);
  EXPECT_GE(precision.num_undetermined, 2);
  EXPECT_EQ(precision.redundancy, oracle.redundancy);
  for (const ImagePrecision& image : precision.images) {
    EXPECT_EQ(image.covariance.has_value(), image.image != 0) << image.image;
  }
  for (const PointPrecision& point : precision.points) {
    EXPECT_TRUE(point.sigma.allFinite());
  }
  for (size_t i = 0; i < precision.observations.size(); ++i) {
    const auto row = static_cast<Index>(2 * i);
    EXPECT_NEAR(precision.observations[i].redundancy.x(), oracle.R(row, row),
                1e-4);
  }
}

// A point that least squares put into a camera, which another one sees from
// behind: all else is as precise as without that point.
TEST(Precision, LeavesOutAPointThatLiesInACamera) {
  Model model = PreciseScene(2, 1);
  const auto indices = ImageIndices(model);
  size_t k = 0;
  const auto is_in_both = [&] {
    int num_in_both = 0;
    for (uint64_t e = model.points3D[k].track_begin;
         e < model.points3D[k].track_end; ++e) {
      num_in_both += indices.at(model.track_elements[e].image_id) < 2;
    }
    return num_in_both == 2;
  };
  while (!is_in_both()) ++k;
  Point3D& point = model.points3D[k];
  const Vector3d centre = CentreOf(ToBlock(model.frames[0].rig_from_world));
  const Vector3d ray = point.xyz - centre;
  Pose& pose = model.frames[1].rig_from_world;
  pose.translation = -(pose.Rotation() * (centre - 0.05 * ray));
  model.images[1].cam_from_world = pose;
  point.xyz = centre + 1e-9 * ray;
  Model without = model;
  without.points3D[k].track_end = without.points3D[k].track_begin;
  const AdjustmentPrecision precision =
      PrecisionOf(model, {}, AdjustmentDatum::kCameras);
  const AdjustmentPrecision expected =
      PrecisionOf(without, {}, AdjustmentDatum::kCameras);
  EXPECT_EQ(precision.num_points_in_cameras, 1);
  EXPECT_EQ(precision.num_undetermined, 0);
  EXPECT_EQ(precision.redundancy, expected.redundancy);
  for (size_t n = 0; n < model.images.size(); ++n) {
    ASSERT_TRUE(precision.images[n].covariance);
    ExpectNear(*precision.images[n].covariance, *expected.images[n].covariance);
  }
}

TEST(Precision, LeavesOutDeviationsBeyondTheImagesThatAreAskedFor) {
  BundleAdjustmentOptions options;
  options.max_num_images_direct_sparse = 3;
  const Model model = PreciseScene(2, 1);
  const AdjustmentPrecision precision =
      PrecisionOf(model, options, AdjustmentDatum::kCameras);
  EXPECT_FALSE(precision.has_covariances);
  EXPECT_EQ(precision.redundancy,
            PrecisionOf(model, {}, AdjustmentDatum::kCameras).redundancy);
}

// 200 scenes with noise of 0.7 px, adjusted from the truth, whose place, turn
// and extent the adjustment keeps: errors of centres, rotations and points
// beyond 1.96 standard deviations are 5 %, and those of focal lengths.
TEST(Precision, CoversTheTruthAsOftenAsItSays) {
  constexpr int kScenes = 200;
  constexpr double kNoise = 0.7;
  int64_t num_poses = 0, poses_within = 0, num_points = 0, points_within = 0;
  int focals_within = 0;
  double squares = 0, redundancy = 0;
  for (int seed = 0; seed < kScenes; ++seed) {
    SceneOptions scene = SceneOf(6, 60, 4, kNoise, seed);
    const Model truth = SynthesizeScene(scene).ground_truth;
    BundleAdjustmentOptions options;
    options.function_tolerance = 1e-10;
    std::optional<AdjustmentPrecision> precision;
    const Model model =
        AdjustBundle(truth, options, {1}, AdjustmentDatum::kCameras, &precision)
            .model;
    ASSERT_TRUE(precision);
    squares += precision->sigma0_px * precision->sigma0_px *
               static_cast<double>(precision->redundancy);
    redundancy += static_cast<double>(precision->redundancy);
    const auto before = ImageGeometries(truth);
    const auto after = ImageGeometries(model);
    for (const ImagePrecision& image : precision->images) {
      const auto& a = before[image.image].cam_from_world;
      const auto& b = after[image.image].cam_from_world;
      const Eigen::AngleAxisd turn(b.rotation * a.rotation.transpose());
      VectorXd error(6);
      error << turn.angle() * turn.axis(), Center(b) - Center(a);
      ASSERT_TRUE(image.covariance);
      for (int c = 0; c < 6; ++c) {
        poses_within +=
            std::abs(error[c]) < 1.96 * std::sqrt((*image.covariance)(c, c));
        ++num_poses;
      }
    }
    for (const PointPrecision& point : precision->points) {
      const Vector3d error =
          model.points3D[point.point].xyz - truth.points3D[point.point].xyz;
      for (int c = 0; c < 3; ++c) {
        points_within += std::abs(error[c]) < 1.96 * point.sigma[c];
        ++num_points;
      }
    }
    const double focal_error =
        model.cameras[0].params[0] - truth.cameras[0].params[0];
    focals_within +=
        std::abs(focal_error) <
        1.96 * std::sqrt((*precision->cameras[0].covariance)(0, 0));
  }
  const auto share = [](int64_t within, int64_t all) {
    return static_cast<double>(within) / static_cast<double>(all);
  };
  // The numbers of a scene depend on each other: those of so many scenes are
  // spread as 200 to 7200 independent ones would be.
  EXPECT_NEAR(share(poses_within, num_poses), 0.95, 0.015);
  EXPECT_NEAR(share(points_within, num_points), 0.95, 0.01);
  EXPECT_NEAR(share(focals_within, kScenes), 0.95, 4 * 0.0154);
  // chi^2 with so many degrees of freedom.
  EXPECT_NEAR(squares / (kNoise * kNoise), redundancy,
              4 * std::sqrt(2 * redundancy));
}

// Noise of 0.7 px, and a start that is off.
SyntheticScene NoisyScene(int num_frames, int num_points, int seed) {
  SceneOptions options = SceneOf(num_frames, num_points, 5, 0.7, seed);
  options.start_translation_noise = 0.002;
  options.start_point_noise = 0.002;
  return SynthesizeScene(options);
}

// 30 scenes whose start is off, in the frame of positions with noise: errors of
// centres beyond 1.96 standard deviations are 5 %, which takes the noise of the
// pixels to be found, too.
TEST(Precision, CoversTheTruthWherePositionsAreKnown) {
  constexpr int kScenes = 30;
  constexpr double kSigma = 0.003;
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(0, kSigma);
  int64_t num_tried = 0, within = 0;
  double sigma0 = 0;
  for (int seed = 0; seed < kScenes; ++seed) {
    const SyntheticScene scene = NoisyScene(12, 150, seed);
    const std::vector<ImageGeometry> truth =
        ImageGeometries(scene.ground_truth);
    AdjustModelOptions adjust;
    adjust.finds_precision = true;
    for (size_t n = 0; n < truth.size(); ++n) {
      const Vector3d off(noise(random), noise(random), noise(random));
      adjust.adjustment.positions.push_back(
          {KnownPosition::Of::kImage, static_cast<int32_t>(n),
           BallAround(Center(truth[n].cam_from_world) + off, 3 * kSigma)});
    }
    const AdjustModelResult result = AdjustModel(scene.model, adjust, {1});
    const std::vector<ImageGeometry> after = ImageGeometries(result.model);
    sigma0 += result.summary.precision->sigma0_px / kScenes;
    for (const ImagePrecision& image : result.summary.precision->images) {
      const Vector3d error = Center(after[image.image].cam_from_world) -
                             Center(truth[image.image].cam_from_world);
      ASSERT_TRUE(image.covariance);
      for (int c = 0; c < 3; ++c) {
        within += std::abs(error[c]) <
                  1.96 * std::sqrt((*image.covariance)(3 + c, 3 + c));
        ++num_tried;
      }
    }
  }
  EXPECT_NEAR(sigma0, 0.7, 0.02);
  const double share =
      static_cast<double>(within) / static_cast<double>(num_tried);
  EXPECT_GT(share, 0.92);
  EXPECT_LT(share, 0.98);
}

// 40 scenes, each scaled by scale bars with noise: of the lengths that are only
// asked for, 5 % are farther off than 1.96 standard deviations.
TEST(Precision, CoversTheTruthOfLengthsWhereDistancesAreKnown) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(0, 1);
  int64_t num_tried = 0, within = 0;
  for (int seed = 0; seed < 40; ++seed) {
    const SyntheticScene scene = NoisyScene(10, 80, seed);
    AdjustModelOptions adjust;
    adjust.finds_precision = true;
    std::vector<KnownDistance>& distances = adjust.adjustment.distances;
    for (int32_t k = 0; k < 40; k += 2) {
      distances.push_back({{Point(k), Point(k + 1)}, {}, 0});
    }
    const std::vector<double> truth = LengthsOf(scene.ground_truth, distances);
    for (size_t n = 0; n < 6; ++n) {
      const double sigma = 1e-3 * truth[n];
      distances[n].metres = truth[n] + sigma * noise(random);
      distances[n].tolerance = 3 * sigma;
    }
    const AdjustModelResult result = AdjustModel(scene.model, adjust, {1});
    EXPECT_EQ(result.summary.adjustment.distances.size(), 6);
    const std::vector<double> after = LengthsOf(result.model, distances);
    for (const DistancePrecision& of : result.summary.precision->distances) {
      if (distances[of.distance].metres) continue;
      within +=
          std::abs(after[of.distance] - truth[of.distance]) < 1.96 * of.sigma;
      ++num_tried;
    }
  }
  EXPECT_EQ(num_tried, 40 * 14);
  const double share =
      static_cast<double>(within) / static_cast<double>(num_tried);
  EXPECT_NEAR(share, 0.95, 0.02);
}

}  // namespace
}  // namespace krot::internal
