#include "krot/tolerance/tolerance_analysis.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/oracle/lp_oracle.h"
#include "tests/testing/edit_model.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

SceneOptions SmallNoisyScene(uint64_t seed, int camera_model_id) {
  SceneOptions options = SceneOf(6, 40, 4, 0.5, seed);
  options.camera_model_id = camera_model_id;
  return options;
}

double LargestErrorOf(const Model& model) {
  return Summarize(PixelErrors(model)).max;
}

// All images and the first points.
ToleranceOptions AskFor(const Model& model, double max_error, int num_points) {
  ToleranceOptions options;
  options.max_error = max_error;
  options.images.resize(model.images.size());
  std::iota(options.images.begin(), options.images.end(), 0);
  options.points.resize(num_points);
  std::iota(options.points.begin(), options.points.end(), 0);
  return options;
}

Vector3d CentreOf(const Model& model, const std::string& image_name) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  for (size_t i = 0; i < model.images.size(); ++i) {
    if (model.images[i].name == image_name) {
      return Center(geometries[i].cam_from_world);
    }
  }
  return Vector3d::Constant(NAN);
}

// x -> scale x + shift that takes another model of the same rotations into the
// gauge of a result.
struct IntoGauge {
  IntoGauge(const ToleranceResult& result, const Model& other) {
    const std::vector<std::string>& names = result.summary.gauge_images;
    const Vector3d first = CentreOf(result.model, names[0]);
    scale = 1;
    if (names.size() > 1) {
      const Vector3d along = CentreOf(result.model, names[1]) - first;
      scale = along.squaredNorm() /
              along.dot(CentreOf(other, names[1]) - CentreOf(other, names[0]));
    }
    shift = first - scale * CentreOf(other, names[0]);
  }
  Vector3d operator()(const Vector3d& x) const { return scale * x + shift; }
  double scale;
  Vector3d shift;
};

bool Holds(const PositionBox& box, const Vector3d& x, double slack = 0) {
  for (int axis = 0; axis < 3; ++axis) {
    if (box.low[axis].proved && x[axis] < *box.low[axis].proved - slack) {
      return false;
    }
    if (box.high[axis].proved && x[axis] > *box.high[axis].proved + slack) {
      return false;
    }
  }
  return true;
}

Vector3d PlaceOf(const ToleranceBox& box, const Model& model) {
  if (box.is_image) return CentreOf(model, box.name);
  const auto point =
      std::find_if(model.points3D.begin(), model.points3D.end(),
                   [&](const Point3D& p) { return p.id == box.id; });
  return point->xyz;
}

TEST(AnalyzeTolerances, HasTheTruthInEachOfAThousandBoxes) {
  constexpr double kRounding = 1e-9;  // of the transform into the gauge
  int num_boxes = 0;
  int num_bounded = 0;
  int num_inside = 0;
  for (uint64_t seed = 1; num_boxes < 1000; ++seed) {
    SceneOptions scene_options =
        SmallNoisyScene(seed, std::array{1, 2, 4}[seed % 3]);
    scene_options.sensors_per_rig = seed % 4 == 0 ? 2 : 1;
    scene_options.has_rigs = scene_options.sensors_per_rig > 1;
    const SyntheticScene scene = SynthesizeScene(scene_options);
    const double max_error = 1.0001 * LargestErrorOf(scene.ground_truth);
    const ToleranceResult result =
        AnalyzeTolerances(scene.model, AskFor(scene.model, max_error, 34));
    ASSERT_EQ(result.summary.termination, ToleranceTermination::kDone);
    const IntoGauge into_gauge(result, scene.ground_truth);
    for (const ToleranceBox& box : result.summary.boxes) {
      ++num_boxes;
      num_inside += Holds(box.box, into_gauge(PlaceOf(box, scene.ground_truth)),
                          kRounding);
      num_bounded += box.box.low[0].proved && box.box.high[2].proved;
    }
  }
  EXPECT_EQ(num_inside, num_boxes);
  EXPECT_GT(num_bounded, 0.95 * num_boxes);
}

// A random walk through the estimates within the bound: to a random place on
// the chord along a random direction.
TEST(AnalyzeTolerances, HasNoRandomEstimateOutsideOfABox) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SceneOptions scene_options = SmallNoisyScene(seed, 1);
    scene_options.num_frames = 4;
    scene_options.num_points = 12;
    scene_options.track_length = 3;
    const Model model = SynthesizeScene(scene_options).model;
    const double max_error = 1.3 * LargestErrorOf(model);
    const ToleranceResult result =
        AnalyzeTolerances(model, AskFor(model, max_error, 12));
    const BuiltProblem built = BuildProblem(result.model, {});
    const Reprojection reprojection(result.model, built);
    const auto is_within = [&](const Estimate& estimate) {
      return reprojection.TrueCost(estimate, Norm{}, 1) <= max_error;
    };
    std::mt19937 generator(static_cast<unsigned>(seed));
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(0, 1);
    Estimate now = built.start;
    ASSERT_TRUE(is_within(now));
    for (int step = 0; step < 2000; ++step) {
      Estimate moved = now;
      const auto at = [&](const Estimate& direction, double length) {
        for (size_t f = 0; f < now.translations.size(); ++f) {
          moved.translations[f] =
              now.translations[f] + length * direction.translations[f];
        }
        for (size_t k = 0; k < now.points.size(); ++k) {
          moved.points[k] = now.points[k] + length * direction.points[k];
        }
        return moved;
      };
      Estimate direction = now;
      const bool moves_all = step % 2 == 0;
      const auto chosen = static_cast<size_t>(
          uniform(generator) *
          static_cast<double>(now.points.size() + now.translations.size()));
      size_t index = 0;
      for (auto* list : {&direction.points, &direction.translations}) {
        for (Vector3d& x : *list) {
          const bool moves = moves_all || index++ == chosen;
          x = moves ? Vector3d(normal(generator), normal(generator),
                               normal(generator))
                    : Vector3d::Zero();
        }
      }
      double length = 1;
      while (length > 1e-12 && !is_within(at(direction, length))) length /= 2;
      now = at(direction, length * uniform(generator));
      Model walked = result.model;
      walked = ApplyEstimate(result.model, built, now);
      const IntoGauge into_gauge(result, walked);
      for (const ToleranceBox& box : result.summary.boxes) {
        ASSERT_TRUE(Holds(box.box, into_gauge(PlaceOf(box, walked)), 1e-9))
            << "seed " << seed << ", step " << step << ", " << box.name << ' '
            << box.id;
      }
    }
  }
}

TEST(AnalyzeTolerances, ReachesTheEndsThatItProves) {
  for (const int camera_model_id : {1, 4}) {
    SCOPED_TRACE(camera_model_id);
    const Model model =
        SynthesizeScene(SmallNoisyScene(7, camera_model_id)).model;
    const ToleranceResult result =
        AnalyzeTolerances(model, AskFor(model, 1.2 * LargestErrorOf(model), 5));
    ASSERT_FALSE(result.summary.boxes.empty());
    for (const ToleranceBox& box : result.summary.boxes) {
      if (box.is_image && !box.box.low[0].proved) ADD_FAILURE() << box.name;
      for (int axis = 0; axis < 3; ++axis) {
        for (const auto& [end, sign] : {std::pair(box.box.low[axis], -1.0),
                                        std::pair(box.box.high[axis], 1.0)}) {
          if (!end.proved) continue;
          const double way = sign * (*end.proved - box.position[axis]);
          const double reached = sign * (end.reached - box.position[axis]);
          EXPECT_GE(way, 0);
          EXPECT_LE(reached, way);
          EXPECT_GE(reached, (camera_model_id == 1 ? 0.99 : 0.95) * way)
              << box.name << box.id << " axis " << axis;
        }
      }
    }
  }
}

TEST(AnalyzeTolerances, HoldsWhatTheOptionsFixAndShrinksTheRest) {
  const Model model = SynthesizeScene(SmallNoisyScene(3, 1)).model;
  ToleranceOptions options = AskFor(model, 1.2 * LargestErrorOf(model), 3);
  const ToleranceResult free = AnalyzeTolerances(model, options);
  options.solve.problem.fixed.frames.assign(model.frames.size(), 0);
  for (int f = 0; f < 3; ++f) options.solve.problem.fixed.frames[f] = 1;
  const ToleranceResult held = AnalyzeTolerances(model, options);
  EXPECT_TRUE(held.summary.gauge_images.empty());
  EXPECT_EQ(held.summary.num_fixed_frames, 3);
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  for (size_t i = 0; i < model.images.size(); ++i) {
    const PositionBox& box = held.summary.boxes[i].box;
    for (int axis = 0; axis < 3; ++axis) {
      ASSERT_TRUE(box.low[axis].proved && box.high[axis].proved);
      const double width = *box.high[axis].proved - *box.low[axis].proved;
      if (geometries[i].frame < 3) {
        EXPECT_EQ(width, 0);
      } else {
        EXPECT_GT(width, 0);
      }
    }
  }
}

TEST(AnalyzeTolerances, SolvesAModelThatIsNotWithinTheBound) {
  SceneOptions scene_options = SmallNoisyScene(5, 1);
  const Model good = SynthesizeScene(scene_options).ground_truth;
  const double max_error = 1.1 * LargestErrorOf(good);
  scene_options.start_translation_noise = 0.02;
  scene_options.start_point_noise = 0.02;
  const Model model = SynthesizeScene(scene_options).model;
  ASSERT_GT(LargestErrorOf(model), 2 * max_error);
  const ToleranceResult result =
      AnalyzeTolerances(model, AskFor(model, max_error, 0));
  EXPECT_EQ(result.summary.termination, ToleranceTermination::kDone);
  EXPECT_TRUE(result.summary.is_solved);
  EXPECT_LT(LargestErrorOf(result.model), max_error);
}

TEST(AnalyzeTolerances, SaysWhereNoEstimateIsWithinTheBound) {
  const Model model = SynthesizeScene(SmallNoisyScene(5, 1)).model;
  const ToleranceResult result =
      AnalyzeTolerances(model, AskFor(model, 0.05, 0));
  EXPECT_EQ(result.summary.termination, ToleranceTermination::kNoEstimate);
  ASSERT_TRUE(result.summary.lower_bound);
  EXPECT_GT(*result.summary.lower_bound, 0.05);
  EXPECT_TRUE(result.summary.boxes.empty());
}

TEST(AnalyzeTolerances, HasTheSameBitsAtAnyNumberOfThreads) {
  const Model model = SynthesizeScene(SmallNoisyScene(9, 4)).model;
  const ToleranceOptions options =
      AskFor(model, 1.2 * LargestErrorOf(model), 2);
  const ToleranceResult a = AnalyzeTolerances(model, options, {1});
  const ToleranceResult b = AnalyzeTolerances(model, options, {3});
  for (size_t n = 0; n < a.summary.boxes.size(); ++n) {
    for (int axis = 0; axis < 3; ++axis) {
      const PositionBox& box_a = a.summary.boxes[n].box;
      const PositionBox& box_b = b.summary.boxes[n].box;
      EXPECT_EQ(box_a.low[axis].proved, box_b.low[axis].proved);
      EXPECT_EQ(box_a.high[axis].proved, box_b.high[axis].proved);
      EXPECT_EQ(box_a.low[axis].reached, box_b.low[axis].reached);
    }
  }
}

TEST(AnalyzeTolerances, HasNoEndBehindAPointThatMayBeInfinitelyFarAway) {
  const Model model = SynthesizeScene(SmallNoisyScene(2, 1)).model;
  // So wide that every pair of rays is parallel within it.
  const ToleranceResult result =
      AnalyzeTolerances(model, AskFor(model, 1e3, 1));
  ASSERT_EQ(result.summary.termination, ToleranceTermination::kDone);
  const PositionBox& box = result.summary.boxes.back().box;
  int num_ends = 0;
  for (int axis = 0; axis < 3; ++axis) {
    num_ends += box.low[axis].proved.has_value();
    num_ends += box.high[axis].proved.has_value();
  }
  EXPECT_LT(num_ends, 6);
}

TEST(AnalyzeTolerances, IsOpenOnlyForAFrameThatMayBeInfinitelyFarAway) {
  for (const size_t image : {0, 3}) {
    const Model model = WithFewObservationsOf(
        image, 1, SynthesizeScene(SmallNoisyScene(3, 1)).model);
    const ToleranceResult result =
        AnalyzeTolerances(model, AskFor(model, 3, 0));
    ASSERT_EQ(result.summary.termination, ToleranceTermination::kDone);
    for (size_t i = 0; i < model.images.size(); ++i) {
      EXPECT_NE(result.summary.gauge_images.back(), model.images[image].name);
      const PositionBox& box = result.summary.boxes[i].box;
      bool is_closed = true;
      for (int axis = 0; axis < 3; ++axis) {
        is_closed = is_closed && box.low[axis].proved && box.high[axis].proved;
      }
      EXPECT_EQ(is_closed, i != image) << i << " without " << image;
    }
    EXPECT_LT(result.summary.agreement.worst, 0.011);
  }
}

TEST(AnalyzeTolerances, RefusesWhatHoldsNothingTogether) {
  const Model model = SynthesizeScene(SmallNoisyScene(5, 1)).model;
  ToleranceOptions options = AskFor(model, 5, 0);
  options.gauge_images = {1, 1};
  EXPECT_THROW(AnalyzeTolerances(model, options), std::invalid_argument);
  options.gauge_images = {1};
  EXPECT_THROW(AnalyzeTolerances(model, options), std::invalid_argument);
  options.gauge_images = {};
  options.max_error = 0;
  EXPECT_THROW(AnalyzeTolerances(model, options), std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
