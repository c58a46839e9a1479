// Cameras that run away and points that are not determined, and all the others
// beside them.

#include "krot/pipeline/solve_model.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/pipeline/solve_by_ranks.h"
#include "tests/testing/edit_model.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using ::testing::IsEmpty;

// Frames 1 away from the middle of the scene.
Model Scene(int num_frames = 12) {
  SceneOptions options = SceneOf(num_frames, 150, 5, 0.5);
  options.camera_model_id = 1;
  options.start_translation_noise = 0.002;
  options.start_point_noise = 0.002;
  options.has_rigs = false;
  return SynthesizeScene(options).model;
}

std::vector<Vector3d> Centres(const Model& model) {
  std::vector<Vector3d> centres;
  for (const ImageGeometry& image : ImageGeometries(model)) {
    centres.push_back(Center(image.cam_from_world));
  }
  return centres;
}

void Place(int image, const Vector3d& centre, Model* model) {
  for (Pose* pose : {&model->images[image].cam_from_world,
                     &model->frames[image].rig_from_world}) {
    pose->translation = -(pose->Rotation() * centre);
  }
}

// The 2D points of an image that belong to a track.
std::vector<Point2D*> Seen(int image, Model* model) {
  std::vector<Point2D*> seen;
  for (Point2D& point : model->images[image].points2D) {
    if (point.point3D_id != kInvalidPoint3DId) seen.push_back(&point);
  }
  return seen;
}

// As of an image that was matched wrongly: its few observations lie on one
// another, so that it is the better the farther away it stands.
Model WithRunaway(Model model, int image, const Vector3d& centre) {
  model = WithFewObservationsOf(image, 4, model);
  double offset = 0;
  for (Point2D* point : Seen(image, &model)) {
    point->x = 0.5 * static_cast<double>(model.cameras[0].width) + offset;
    point->y = 0.5 * static_cast<double>(model.cameras[0].height);
    offset += 0.01;
  }
  Place(image, centre, &model);
  return model;
}

// On the axis of an image, so far away that the scene is in front of it.
Vector3d OnAxis(int image, double distance, const Model& model) {
  return -distance *
         model.images[image].cam_from_world.Rotation().row(2).transpose();
}

Vector3d CentroidWithout(const std::vector<int>& images, const Model& model) {
  Vector3d sum = Vector3d::Zero();
  double count = 0;
  const std::vector<Vector3d> centres = Centres(model);
  for (size_t n = 0; n < centres.size(); ++n) {
    if (std::count(images.begin(), images.end(), static_cast<int>(n))) continue;
    sum += centres[n];
    count += 1;
  }
  return sum / count;
}

double RmsWithout(const std::vector<int>& images, const Model& model) {
  const Vector3d centroid = CentroidWithout(images, model);
  double sum = 0;
  double count = 0;
  const std::vector<Vector3d> centres = Centres(model);
  for (size_t n = 0; n < centres.size(); ++n) {
    if (std::count(images.begin(), images.end(), static_cast<int>(n))) continue;
    sum += (centres[n] - centroid).squaredNorm();
    count += 1;
  }
  return std::sqrt(sum / count);
}

void ExpectPlaceAndSizeOfOthers(const std::vector<int>& images,
                                const Model& before, const Model& after) {
  EXPECT_LT(
      (CentroidWithout(images, after) - CentroidWithout(images, before)).norm(),
      1e-9);
  EXPECT_NEAR(RmsWithout(images, after), RmsWithout(images, before), 1e-9);
}

TEST(SettleEstimate, SaysNothingOfASoundModel) {
  const Model model = Scene();
  const SolveModelResult result = SolveModel(model, {});
  EXPECT_THAT(result.summary.loose.images, IsEmpty());
  EXPECT_THAT(result.summary.loose.points, IsEmpty());
  ExpectPlaceAndSizeOfOthers({}, model, result.model);
}

TEST(SettleEstimate, NamesARunawayAndKeepsPlaceAndSizeOfTheOthers) {
  for (const Vector3d& centre :
       {Vector3d(4e4, 5e4, 9e3), Vector3d(-30, 10, 20), Vector3d(0, 0, 3)}) {
    const Model model = WithRunaway(Scene(), 5, centre);
    const SolveModelResult result = SolveModel(model, {});
    ASSERT_FALSE(result.summary.is_given_back);
    ASSERT_EQ(result.summary.loose.images.size(), 1);
    const LooseImage& image = result.summary.loose.images[0];
    EXPECT_EQ(image.image_name, model.images[5].name);
    EXPECT_EQ(image.num_observations, 4);
    EXPECT_FALSE(image.is_determined);
    EXPECT_NEAR(image.moved,
                (Centres(result.model)[5] - Centres(model)[5]).norm(),
                1e-6 * image.moved);
    ExpectPlaceAndSizeOfOthers({5}, model, result.model);
    // Its rays diverge from the scene by a few units of its focal length.
    EXPECT_LT(Centres(result.model)[5].norm(), centre.norm() + 1e4);
  }
}

TEST(SettleEstimate, SaysHowFarARunawayIsAfterAPolish) {
  const Model model = WithRunaway(Scene(), 5, {4e4, 5e4, 9e3});
  for (const Polish polish : {Polish::kRotationsFixed, Polish::kFull}) {
    SolveModelOptions options;
    options.polish = polish;
    const SolveModelResult result = SolveModel(model, options);
    ASSERT_EQ(result.summary.loose.images.size(), 1);
    const double moved = result.summary.loose.images[0].moved;
    EXPECT_NEAR(moved, (Centres(result.model)[5] - Centres(model)[5]).norm(),
                1e-6 * moved);
  }
}

TEST(SettleEstimate, LeavesARunawayWhereThatIsAsGood) {
  const Model scene = Scene();
  for (const double distance : {3e3, 3e4, 3e8}) {
    const Model model = WithRunaway(scene, 5, OnAxis(5, distance, scene));
    const SolveModelResult result = SolveModel(model, {});
    ASSERT_EQ(result.summary.loose.images.size(), 1);
    // It moves across its rays alone, by pixels.
    EXPECT_LT(result.summary.loose.images[0].moved, 2e-3 * distance);
    ExpectPlaceAndSizeOfOthers({5}, model, result.model);
  }
}

TEST(SettleEstimate, NamesACameraThatComesBack) {
  // Its observations are right and many; only its position was wrong.
  Model model = Scene();
  const Vector3d was = Centres(model)[3];
  Place(3, 1e4 * was, &model);
  const SolveModelResult result = SolveModel(model, {});
  ASSERT_EQ(result.summary.loose.images.size(), 1);
  EXPECT_EQ(result.summary.loose.images[0].image_id, model.images[3].id);
  EXPECT_TRUE(result.summary.loose.images[0].is_determined);
  EXPECT_LT((Centres(result.model)[3] - was).norm(), 0.1);
  ExpectPlaceAndSizeOfOthers({3}, model, result.model);
}

TEST(SettleEstimate, NamesACameraWithASingleRay) {
  Model model = Scene();
  model = WithFewObservationsOf(7, 1, model);
  const SolveModelResult result = SolveModel(model, {});
  ASSERT_EQ(result.summary.loose.images.size(), 1);
  EXPECT_EQ(result.summary.loose.images[0].image_id, model.images[7].id);
  EXPECT_EQ(result.summary.loose.images[0].num_observations, 1);
  // It keeps its distance from the point that it sees.
  EXPECT_LT(result.summary.loose.images[0].moved, 0.05);
}

// A twin of an image, in the same place: what both see, and nobody else, is not
// determined.
struct Twins {
  Model model;
  std::vector<Point3DId> undetermined;
};

Twins WithTwin(Model model) {
  Twins twins;
  Image twin = model.images[2];
  twin.id = 1000;
  twin.name = "twin";
  twin.points2D.clear();
  const RigidTransform pose = twin.cam_from_world.Transform();
  const Camera& camera = model.cameras[0];
  for (int n = 0; n < 6; ++n) {
    Point3D point;
    point.id = 10000 + n;
    const double depth = 0.5 + 0.3 * n;
    point.xyz = Inverse(pose) * Vector3d(0.05 * n - 0.1, 0.1, depth);
    point.track_begin = model.track_elements.size();
    twins.undetermined.push_back(point.id);
    const Vector2d pixel = *ProjectPoint(camera, pose * point.xyz);
    int side = 1;
    for (Image* image : {&model.images[2], &twin}) {
      model.track_elements.push_back(
          {image->id, static_cast<uint32_t>(image->points2D.size())});
      image->points2D.push_back(
          {pixel.x() + side * 0.2, pixel.y() - side * 0.3 * n / 5, point.id});
      side = -1;
    }
    point.track_end = model.track_elements.size();
    model.points3D.push_back(point);
  }
  // It sees all that the image sees, so that both are held by the same.
  for (Point3D& point : model.points3D) {
    std::vector<TrackElement> track(
        model.track_elements.begin() + point.track_begin,
        model.track_elements.begin() + point.track_end);
    const auto seen =
        std::find_if(track.begin(), track.end(), [&](const TrackElement& e) {
          return e.image_id == model.images[2].id;
        });
    if (seen == track.end() || track.back().image_id == twin.id) continue;
    const Point2D pixel = model.images[2].points2D[seen->point2D_idx];
    track.push_back({twin.id, static_cast<uint32_t>(twin.points2D.size())});
    twin.points2D.push_back(pixel);
    point.track_begin = model.track_elements.size();
    model.track_elements.insert(model.track_elements.end(), track.begin(),
                                track.end());
    point.track_end = model.track_elements.size();
  }
  model.images.push_back(twin);
  // Tracks lie one after another.
  std::vector<TrackElement> elements;
  for (Point3D& point : model.points3D) {
    const uint64_t begin = elements.size();
    elements.insert(elements.end(),
                    model.track_elements.begin() + point.track_begin,
                    model.track_elements.begin() + point.track_end);
    point.track_begin = begin;
    point.track_end = elements.size();
  }
  model.track_elements = std::move(elements);
  UseTrivialRigs(&model);
  twins.model = std::move(model);
  return twins;
}

std::vector<Point3DId> Ids(const std::vector<LoosePoint>& points) {
  std::vector<Point3DId> ids;
  for (const LoosePoint& point : points) ids.push_back(point.point3D_id);
  return ids;
}

TEST(SettleEstimate, KeepsPointsThatAreSeenFromOnePlaceWhereTheyAre) {
  const Twins twins = WithTwin(Scene());
  const SolveModelResult result = SolveModel(twins.model, {});
  EXPECT_EQ(Ids(result.summary.loose.points), twins.undetermined);
  for (const LoosePoint& point : result.summary.loose.points) {
    EXPECT_LT(point.moved, 0.01);
  }
  EXPECT_THAT(result.summary.loose.images, IsEmpty());
  ExpectPlaceAndSizeOfOthers({}, twins.model, result.model);
}

TEST(SettleEstimate, SettlesPointsThatAreTriangulatedAlone) {
  const Twins twins = WithTwin(Scene());
  const SolveModelResult result = TriangulateModel(twins.model, {});
  EXPECT_EQ(Ids(result.summary.loose.points), twins.undetermined);
  for (const LoosePoint& point : result.summary.loose.points) {
    EXPECT_LT(point.moved, 0.02);
  }
}

TEST(SettleEstimate, RaisesNoLargestErrorAndHardlyTheSumOfSquares) {
  const Twins twins = WithTwin(WithRunaway(Scene(), 5, {4e4, 5e4, 9e3}));
  const SolveModelResult result = SolveModel(twins.model, {});
  const SolveSummary& summary = result.summary;
  EXPECT_NEAR(summary.pixel_error_after.max, summary.cost_final, 1e-9);
  EXPECT_LE(summary.cost_final, summary.finish->cap);
  EXPECT_NEAR(summary.pixel_error_after.rms,
              std::sqrt(2 * summary.finish->solve.cost_final /
                        static_cast<double>(summary.num_observations)),
              1e-9);
  EXPECT_TRUE(summary.is_certified);
}

// Clouds and skylines: infinitely far away for all that the images say, and no
// nearer.
TEST(SettleEstimate, SaysNothingOfPointsThatAreFarAway) {
  Model model = Scene();
  const Camera& camera = model.cameras[0];
  for (int n = 0; n < 8; ++n) {
    Point3D point;
    point.id = 10000 + n;
    const RigidTransform pose = model.images[0].cam_from_world.Transform();
    point.xyz = Inverse(pose) *
                (std::pow(10.0, 2 + n % 4) * Vector3d(0.05 * n - 0.2, 0.1, 1));
    point.track_begin = model.track_elements.size();
    for (Image& image : model.images) {
      const auto pixel =
          ProjectPoint(camera, image.cam_from_world.Transform() * point.xyz);
      if (!pixel || pixel->x() < 0 || pixel->y() < 0 ||
          pixel->x() > static_cast<double>(camera.width) ||
          pixel->y() > static_cast<double>(camera.height)) {
        continue;
      }
      model.track_elements.push_back(
          {image.id, static_cast<uint32_t>(image.points2D.size())});
      image.points2D.push_back({pixel->x() + 0.3 * std::sin(7 * n + image.id),
                                pixel->y(), point.id});
    }
    point.track_end = model.track_elements.size();
    model.points3D.push_back(point);
  }
  const SolveModelResult result = SolveModel(model, {});
  EXPECT_THAT(result.summary.loose.points, IsEmpty());
  EXPECT_THAT(result.summary.loose.images, IsEmpty());
}

TEST(SettleEstimate, HasTheBitsOfOneProcessByRanks) {
  const Model scene = Scene();
  const Model whole =
      WithTwin(WithRunaway(scene, 5, OnAxis(5, 50, scene))).model;
  SolveModelResult alone = SolveModel(whole, {}, Context{1});
  ASSERT_FALSE(alone.summary.loose.points.empty());
  ASSERT_FALSE(alone.summary.loose.images.empty());
  const Solved by_ranks = SolveByRanks(whole, {}, 3);
  EXPECT_EQ(Ids(by_ranks.summary.loose.points),
            Ids(alone.summary.loose.points));
  ExpectSameBits(by_ranks, {std::move(alone.model), std::move(alone.summary)});
}

}  // namespace
}  // namespace krot::internal
