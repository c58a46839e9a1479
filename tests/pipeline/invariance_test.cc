#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/analysis/model_comparison.h"
#include "krot/model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

// What a model is called and measured in decides nothing.

namespace krot::internal {
namespace {

// Of costs within the gap that is asked for, relative.
constexpr double kSolvedGap = 1e-5;
constexpr double kTolerance = 2 * kSolvedGap;

Model InvariantScene() {
  SceneOptions options = SceneOf(7, 80, 4, 0.5, 8);
  options.sensors_per_rig = 2;
  options.start_translation_noise = 0.004;
  options.start_point_noise = 0.004;
  return SynthesizeScene(options).model;
}

SolveModelResult SolveClosely(const Model& model) {
  SolveModelOptions options;
  options.joint.relative_gap = kSolvedGap;
  options.finish.finish = Finish::kNone;
  SolveModelResult result = SolveModel(model, options);
  EXPECT_EQ(result.summary.termination, SolveTermination::kGapReached);
  ValidateModel(result.model);
  return result;
}

// That the two models have the same optimum, up to the unit of a pixel.
void ExpectSameOptimum(const Model& a, const Model& b, double unit = 1) {
  const SolveSummary first = SolveClosely(a).summary;
  const SolveSummary second = SolveClosely(b).summary;
  EXPECT_NEAR(second.cost_final, unit * first.cost_final,
              kTolerance * unit * first.cost_final);
  EXPECT_NEAR(*second.lower_bound, unit * *first.lower_bound,
              kTolerance * unit * first.cost_final);
}

TEST(Invariance, OfWhereTheModelLiesAndOfItsUnit) {
  const Model model = InvariantScene();
  for (const double scale : {1e-6, 1.0, 1e6}) {
    SCOPED_TRACE(scale);
    const Similarity similarity{
        scale,
        Eigen::AngleAxisd(2, Eigen::Vector3d(1, -2, 3).normalized())
            .toRotationMatrix(),
        scale * Eigen::Vector3d(30, -20, 10)};
    ExpectSameOptimum(model, TransformModel(model, similarity));
  }
}

// Any ids and names in any order, those of tracks included.
Model Renamed(Model model) {
  const auto image_id = [](ImageId id) { return 4000000000u - 7 * id; };
  const auto point_id = [](Point3DId id) {
    return id == kInvalidPoint3DId ? id : (Point3DId{1} << 60) - 3 * id;
  };
  const auto camera_id = [](CameraId id) { return 900u - id; };
  const auto rename = [&](SensorId* id) { id->id = camera_id(id->id); };
  for (Camera& camera : model.cameras) camera.id = camera_id(camera.id);
  for (Rig& rig : model.rigs) {
    rig.id += 50;
    rename(&*rig.ref_sensor_id);
    for (RigSensor& sensor : rig.sensors) rename(&sensor.sensor_id);
  }
  for (Frame& frame : model.frames) {
    frame.id = 70000 - frame.id;
    frame.rig_id += 50;
    for (FrameData& data : frame.data) {
      rename(&data.sensor_id);
      data.data_id = image_id(static_cast<ImageId>(data.data_id));
    }
  }
  for (Image& image : model.images) {
    image.id = image_id(image.id);
    image.camera_id = camera_id(image.camera_id);
    image.name = "ünter/" + std::to_string(image.id % 1000) + " a";
    for (Point2D& point : image.points2D) {
      point.point3D_id = point_id(point.point3D_id);
    }
  }
  for (Point3D& point : model.points3D) point.id = point_id(point.id);
  for (TrackElement& element : model.track_elements) {
    element.image_id = image_id(element.image_id);
  }
  for (const Point3D& point : model.points3D) {
    std::reverse(model.track_elements.begin() + point.track_begin,
                 model.track_elements.begin() + point.track_end);
  }
  return model;
}

TEST(Invariance, OfIdsNamesAndOrder) {
  const Model model = InvariantScene();
  ExpectSameOptimum(model, Renamed(model));
}

// Every point's first observation stands there twice, as a 2D point of its own.
Model WithTwins(const Model& model) {
  Model twins = model;
  std::map<ImageId, Image*> images;
  for (Image& image : twins.images) images[image.id] = &image;
  twins.track_elements.clear();
  for (Point3D& point : twins.points3D) {
    const auto begin = model.track_elements.begin() + point.track_begin;
    const auto end = model.track_elements.begin() + point.track_end;
    TrackElement twin = *begin;
    std::vector<Point2D>& points2D = images[twin.image_id]->points2D;
    points2D.push_back(Point2D(points2D[twin.point2D_idx]));
    twin.point2D_idx = static_cast<uint32_t>(points2D.size() - 1);
    point.track_begin = twins.track_elements.size();
    twins.track_elements.insert(twins.track_elements.end(), begin, end);
    twins.track_elements.push_back(twin);
    point.track_end = twins.track_elements.size();
  }
  return twins;
}

TEST(Invariance, OfAnObservationThatIsSaidTwice) {
  const Model model = InvariantScene();
  ExpectSameOptimum(model, WithTwins(model));
}

// SIMPLE_RADIAL images of four times the resolution.
TEST(Invariance, OfTheUnitOfPixels) {
  const Model model = InvariantScene();
  Model larger = model;
  for (Camera& camera : larger.cameras) {
    camera.width *= 4;
    camera.height *= 4;
    for (int n = 0; n < 3; ++n) camera.params[n] *= 4;
  }
  for (Image& image : larger.images) {
    for (Point2D& point : image.points2D) {
      point.x *= 4;
      point.y *= 4;
    }
  }
  ExpectSameOptimum(model, larger, 4);
}

}  // namespace
}  // namespace krot::internal
