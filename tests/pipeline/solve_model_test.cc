#include "krot/pipeline/solve_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/camera/camera_model.h"
#include "krot/convert/certificate_file.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/problem/cost.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

constexpr Ignoring kWhatASolveChanges = {true, true, true};

SceneOptions NoisyScene() {
  SceneOptions options = SceneOf(8, 100, 4, 0.5);
  options.start_translation_noise = 0.005;
  options.start_point_noise = 0.005;
  return options;
}

// The cost of a model, from scratch.
double CostOf(const Model& model) {
  const BuiltProblem built = BuildProblem(model, {});
  return Cost(built.problem, built.start, Norm::L2(), 1);
}

TEST(SolveModel, ReportsTheCostsOfTheModelsItTakesAndGives) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  for (const SolveMethod method :
       {SolveMethod::kAuto, SolveMethod::kResInt, SolveMethod::kJoint}) {
    SolveModelOptions options;
    options.method = method;
    const SolveModelResult result = SolveModel(model, options);
    const SolveSummary& summary = result.summary;
    EXPECT_EQ(summary.method, method);
    EXPECT_NEAR(summary.cost_initial, CostOf(model), 1e-9);
    EXPECT_NEAR(summary.cost_final, CostOf(result.model), 1e-9);
    EXPECT_LT(summary.cost_final, summary.cost_initial);
  }
}

// Two images that see a point in the centre of a camera, but for a hair.
Model WithAPointInACamera(Model model) {
  Point3D point;
  point.id = 1000000;
  point.track_begin = model.track_elements.size();
  const RigidTransform first = ImageGeometries(model)[0].cam_from_world;
  point.xyz =
      Center(first) + first.rotation.transpose() * Eigen::Vector3d(0, 0, 1e-12);
  for (size_t n = 0; n < 2; ++n) {
    Image& image = model.images[n];
    const Camera& camera = model.cameras[0];
    const Eigen::Vector2d pixel =
        ProjectPoint(camera,
                     ImageGeometries(model)[n].cam_from_world * point.xyz)
            .value_or(Eigen::Vector2d::Zero());
    model.track_elements.push_back(
        {image.id, static_cast<uint32_t>(image.points2D.size())});
    image.points2D.push_back({pixel.x(), pixel.y(), point.id});
  }
  point.track_end = model.track_elements.size();
  model.points3D.push_back(point);
  return model;
}

TEST(SolveModel, ReportsTheMaximumOfTheModelThatItGives) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  for (const Model& input : {model, WithAPointInACamera(model)}) {
    for (const Norm norm : {Norm::L1(), Norm::L2(), Norm::LInf()}) {
      SolveModelOptions options;
      options.norm = norm;
      const SolveModelResult result = SolveModel(input, options);
      const std::vector<double> errors = PixelErrors(result.model, -1, norm);
      EXPECT_EQ(result.summary.cost_final,
                *std::max_element(errors.begin(), errors.end()));
    }
  }
}

TEST(SolveModel, ProvesTheGapOfTheModelItGives) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  SolveModelOptions options;
  options.describe_certificate = true;
  for (const Norm norm : {Norm::L1(), Norm::L2(), Norm::LInf()}) {
    options.norm = norm;
    const SolveModelResult result = SolveModel(model, options);
    const SolveSummary& summary = result.summary;
    EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
    ASSERT_TRUE(summary.is_certified);
    const double lowest = summary.LowestCost();
    EXPECT_LE(lowest - *summary.lower_bound, 1e-4 * lowest);
    EXPECT_LE(*summary.relative_gap, options.finish.slack);
    EXPECT_EQ(*summary.relative_gap,
              (summary.cost_final - *summary.lower_bound) / summary.cost_final);

    const CertificateVerdict verdict =
        VerifyCertificateFile(result.model, *summary.certificate);
    ASSERT_TRUE(verdict.is_accepted) << verdict.refusal;
    EXPECT_EQ(verdict.lower_bound, *summary.lower_bound);
    EXPECT_NEAR(verdict.cost.value(), summary.cost_final, 1e-9);
  }
}

TEST(SolveModel, CountsIterationsAndSecondsOverAllStages) {
  SolveModelOptions options;
  options.init = SolveInit::kFeasible;
  int calls = 0;
  options.joint.callback = [&](int iteration, const JointIteration&) {
    EXPECT_EQ(iteration, ++calls);
  };
  const SolveSummary summary =
      SolveModel(SynthesizeScene(NoisyScene()).model, options).summary;
  EXPECT_EQ(static_cast<int>(summary.iterations.size()), calls);
  const auto is_joint = [](const JointIteration& state) {
    return !state.target;
  };
  const auto first_joint = std::find_if(summary.iterations.begin(),
                                        summary.iterations.end(), is_joint);
  EXPECT_NE(first_joint, summary.iterations.begin());
  ASSERT_NE(first_joint, summary.iterations.end());
  EXPECT_LE((first_joint - 1)->seconds, summary.sweeps.front().seconds);
  EXPECT_LE(summary.sweeps.front().seconds, first_joint->seconds);
  ASSERT_TRUE(summary.num_working_observations);
  EXPECT_GT(*summary.num_working_observations, 0);
  EXPECT_LE(*summary.num_working_observations, summary.num_observations);
}

TEST(SolveModel, ListsTheSupportWorstFirstWithMultipliersOfSumOne) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  SolveModelOptions options;
  options.finish.finish = Finish::kNone;
  const SolveSummary summary = SolveModel(model, options).summary;
  ASSERT_GE(summary.support.size(), 2u);
  double sum = 0;
  double last_px = summary.cost_final * (1 + 1e-12);
  for (const SupportObservation& observation : summary.support) {
    sum += observation.multiplier;
    EXPECT_LE(observation.error_px, last_px);
    last_px = observation.error_px;
  }
  EXPECT_NEAR(sum, 1, 1e-12);
  // All of it lies at the maximum, but for the gap.
  EXPECT_GT(last_px, 0.98 * summary.cost_final);
}

// Gives a model's camera the distortion that turns back just beyond the ray
// that is farthest off the axis, and moves every 2D point as that moves its
// point. Returns that ray's 2D point.
std::pair<const Image*, uint32_t> FoldBeyondTheFarthestRay(Model* model) {
  struct Ray {
    Image* image = nullptr;
    uint32_t point2D_idx = 0;
    Eigen::Vector2d u = Eigen::Vector2d::Zero();
  };
  std::vector<Ray> rays;
  const std::vector<ImageGeometry> geometries = ImageGeometries(*model);
  const auto images = ImageIndices(*model);
  for (const Point3D& point : model->points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model->track_elements[e];
      const auto n = images.at(element.image_id);
      const Eigen::Vector3d x_cam = geometries[n].cam_from_world * point.xyz;
      rays.push_back(
          {&model->images[n], element.point2D_idx, x_cam.hnormalized()});
    }
  }
  const Ray farthest = *std::max_element(
      rays.begin(), rays.end(),
      [](const Ray& a, const Ray& b) { return a.u.norm() < b.u.norm(); });
  Camera& camera = model->cameras[0];  // f, cx, cy, k: r (1 + k r^2)
  const std::vector<double> before = camera.params;
  camera.params[3] = -1 / (3 * std::pow(1.001 * farthest.u.norm(), 2));
  for (const Ray& ray : rays) {
    const Eigen::Vector2d moved =
        ProjectRay({camera.model_id, camera.params.data()}, ray.u) -
        ProjectRay({camera.model_id, before.data()}, ray.u);
    Point2D& point2D = ray.image->points2D[ray.point2D_idx];
    point2D.x += moved.x();
    point2D.y += moved.y();
  }
  return {farthest.image, farthest.point2D_idx};
}

TEST(SolveModel, NamesWhatNoProofCanRestOnAsTheLensFolds) {
  Model model = SynthesizeScene(SceneOf(6, 40, 4, 0.3)).model;
  const auto [image, point2D_idx] = FoldBeyondTheFarthestRay(&model);
  SolveModelOptions options;
  options.method = SolveMethod::kJoint;
  EXPECT_THAT(SolveModel(model, options).summary.at_folds,
              ::testing::IsEmpty());

  // Across the radius, so that the fold stays near.
  Point2D& pixel =
      model.images[image - model.images.data()].points2D[point2D_idx];
  const std::vector<double>& params = model.cameras[0].params;
  const Eigen::Vector2d from_centre(pixel.x - params[1], pixel.y - params[2]);
  const Eigen::Vector2d moved =
      from_centre.norm() *
      (from_centre + 3 * from_centre.unitOrthogonal()).normalized();
  pixel.x = params[1] + moved.x();
  pixel.y = params[2] + moved.y();
  const SolveSummary summary = SolveModel(model, options).summary;
  ASSERT_EQ(summary.at_folds.size(), 1u);
  EXPECT_EQ(summary.at_folds[0].image_id, image->id);
  EXPECT_EQ(summary.at_folds[0].image_name, image->name);
  EXPECT_EQ(summary.at_folds[0].point2D_idx, point2D_idx);
  EXPECT_EQ(summary.at_folds[0].camera_id, model.cameras[0].id);
  for (const SupportObservation& observation : summary.support) {
    EXPECT_FALSE(observation.image_id == image->id &&
                 observation.point2D_idx == point2D_idx);
  }

  // Where the rows' bound has shown a local minimum, rounds end. From nothing
  // another one may be found, but joint iterations from the model's own start
  // are not tried.
  options.method = SolveMethod::kAuto;
  const std::vector<Round> rounds = SolveModel(model, options).summary.rounds;
  int num_minima = 0;
  for (size_t n = 0; n < rounds.size(); ++n) {
    const std::optional<double> bound = rounds[n].linear_lower_bound;
    const double gap = options.joint.relative_gap * rounds[n].cost;
    if (!bound || rounds[n].cost - *bound > gap) continue;
    ++num_minima;
    if (n + 1 == rounds.size()) break;
    EXPECT_GT(rounds[n + 1].cost, rounds[n].cost);
  }
  EXPECT_GE(num_minima, 1);
  EXPECT_LE(num_minima, 2);
}

TEST(SolveModel, IsDoneAtOnceWhereEveryErrorIsZero) {
  SceneOptions scene = SceneOf(8, 100);
  const Model model = SynthesizeScene(scene).model;
  ASSERT_LT(CostOf(model), 1e-9);
  for (const SolveMethod method : {SolveMethod::kAuto, SolveMethod::kJoint}) {
    SolveModelOptions options;
    options.method = method;
    const SolveModelResult result = SolveModel(model, options);
    EXPECT_EQ(result.summary.termination, SolveTermination::kZeroCost);
    EXPECT_TRUE(result.summary.sweeps.empty());
    EXPECT_TRUE(result.summary.iterations.empty());
    EXPECT_LT(CostOf(result.model), 1e-9);
  }
}

TEST(SolveModel, EndsWhereEveryErrorHasBecomeZero) {
  SceneOptions scene = NoisyScene();
  scene.pixel_noise = 0;
  const Model model = SynthesizeScene(scene).model;
  ASSERT_GT(CostOf(model), 1);
  const SolveModelResult result = SolveModel(model, {});
  EXPECT_EQ(result.summary.termination, SolveTermination::kZeroCost);
  // Of every round; they converge quadratically.
  EXPECT_LE(result.summary.rounds.size(), 4u);
  EXPECT_LT(result.summary.iterations.size(),
            60 * result.summary.rounds.size());
  EXPECT_LT(CostOf(result.model), 1e-9);
}

TEST(SolveModel, BoundsNothingBySweepsAlone) {
  SolveModelOptions options;
  options.method = SolveMethod::kResInt;
  const SolveSummary summary =
      SolveModel(SynthesizeScene(NoisyScene()).model, options).summary;
  EXPECT_EQ(summary.termination, SolveTermination::kStalled);
  EXPECT_FALSE(summary.is_certified);
  EXPECT_FALSE(summary.lower_bound.has_value());
  EXPECT_FALSE(summary.relative_gap.has_value());
  EXPECT_TRUE(summary.iterations.empty());
  EXPECT_TRUE(summary.support.empty());
}

TEST(SolveModel, SweepsAloneForANormWithoutAJointSolver) {
  SolveModelOptions options;
  options.norm = {3};
  EXPECT_EQ(EffectiveMethod(options), SolveMethod::kResInt);
  const Model model = SynthesizeScene(NoisyScene()).model;
  EXPECT_EQ(SolveModel(model, options).summary.method, SolveMethod::kResInt);
  options.method = SolveMethod::kJoint;
  EXPECT_THROW(SolveModel(model, options), std::invalid_argument);
}

TEST(SolveModel, FindsTheSameOptimumFromNothing) {
  for (const int sensors_per_rig : {1, 2}) {
    SceneOptions scene = NoisyScene();
    scene.sensors_per_rig = sensors_per_rig;
    const Model model = SynthesizeScene(scene).model;
    const double cost = SolveModel(model, {}).summary.cost_final;
    SolveModelOptions options;
    options.init = SolveInit::kFeasible;
    const SolveModelResult result = SolveModel(model, options);
    EXPECT_EQ(result.summary.init, SolveInit::kFeasible);
    EXPECT_EQ(result.summary.termination, SolveTermination::kGapReached);
    EXPECT_NEAR(result.summary.cost_final, cost, 2e-4 * cost);
    EXPECT_NEAR(CostOf(result.model), result.summary.cost_final, 1e-9);
  }
}

TEST(SolveModel, ProvesThatABoundIsInfeasible) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  SolveModelOptions options;
  options.init = SolveInit::kFeasible;
  options.init_max_error = 0.1;
  options.describe_certificate = true;
  const SolveModelResult result = SolveModel(model, options);
  EXPECT_EQ(result.summary.termination, SolveTermination::kInfeasible);
  EXPECT_THAT(result.model, IsModel(model));
  ASSERT_TRUE(result.summary.is_certified);
  EXPECT_GT(*result.summary.lower_bound, 0.1);
  EXPECT_FALSE(result.summary.relative_gap.has_value());
  EXPECT_TRUE(
      VerifyCertificateFile(model, *result.summary.certificate).is_accepted);
}

TEST(SolveModel, GivesAValidModelThatDiffersInPosesPointsAndErrorsOnly) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  const SolveModelResult result = SolveModel(model, {});
  EXPECT_NO_THROW(ValidateModel(result.model));
  EXPECT_THAT(result.model, IsModel(model, kWhatASolveChanges));
}

TEST(SolveModel, MeasuresPixelErrorsBeforeAndAfterAndStoresThem) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  const SolveModelResult result = SolveModel(model, {});
  const std::vector<double> after_px = PixelErrors(result.model);
  EXPECT_EQ(result.summary.pixel_error_before.max,
            Summarize(PixelErrors(model)).max);
  EXPECT_EQ(result.summary.pixel_error_after.max, Summarize(after_px).max);
  Model updated = result.model;
  UpdatePointErrors(after_px, &updated);
  EXPECT_THAT(result.model, IsModel(updated));
}

// Large enough for loops of several chunks, and for threads in factors.
TEST(SolveModel, GivesTheSameBitsAtAnyNumberOfThreads) {
  SceneOptions scene = NoisyScene();
  scene.num_points = 2500;
  scene.camera_model_id = FindCameraModel("OPENCV_FISHEYE")->id;
  const Model model = SynthesizeScene(scene).model;
  for (const SolveInit init : {SolveInit::kModel, SolveInit::kFeasible}) {
    SolveModelOptions options;
    options.init = init;
    const Model expected = SolveModel(model, options, {1}).model;
    for (const int num_threads : {2, 3}) {
      EXPECT_THAT(SolveModel(model, options, {num_threads}).model,
                  IsModel(expected));
    }
  }
}

// The same records, last first; tracks keep their order.
Model Reversed(Model model) {
  std::reverse(model.cameras.begin(), model.cameras.end());
  std::reverse(model.rigs.begin(), model.rigs.end());
  std::reverse(model.frames.begin(), model.frames.end());
  std::reverse(model.images.begin(), model.images.end());
  std::reverse(model.points3D.begin(), model.points3D.end());
  return model;
}

TEST(SolveModel, GivesTheSameBitsWhateverTheOrderOfTheRecords) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  EXPECT_THAT(Reversed(SolveModel(Reversed(model), {}).model),
              IsModel(SolveModel(model, {}).model));
}

TEST(SolveModel, ReturnsTheModelUnchangedIfThereIsNothingToSolve) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  SolveModelOptions options;
  options.problem.min_track_length = 1000;
  const SolveModelResult result = SolveModel(model, options);
  EXPECT_EQ(result.summary.termination, SolveTermination::kNothingToSolve);
  EXPECT_EQ(result.summary.num_observations, 0);
  EXPECT_EQ(std::accumulate(result.summary.left_out.begin(),
                            result.summary.left_out.end(), int64_t{0}),
            static_cast<int64_t>(model.track_elements.size()));
  EXPECT_THAT(result.model, IsModel(model));
}

TEST(SolveModel, AnnouncesTheCountsBeforeItSolves) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  SolveModelOptions options;
  int num_calls = 0;
  int num_sweeps = 0;
  options.on_built = [&](const SolveSummary& summary) {
    ++num_calls;
    EXPECT_EQ(num_sweeps, 0);
    EXPECT_EQ(summary.num_images, 8);
    EXPECT_EQ(summary.num_points, 100);
    EXPECT_EQ(summary.num_observations,
              static_cast<int64_t>(model.track_elements.size()));
  };
  options.res_int.callback = [&](int, const Sweep&) { ++num_sweeps; };
  SolveModel(model, options);
  EXPECT_EQ(num_calls, 1);
  EXPECT_GT(num_sweeps, 0);
}

TEST(SolveModel, GivesTheBestSoFarWhenInterrupted) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  CancelFlag cancel{false};
  SolveModelOptions options;
  options.method = SolveMethod::kResInt;
  options.res_int.sweep_tolerance = 0;
  options.res_int.callback = [&](int sweep, const Sweep&) {
    if (sweep == 2) cancel = true;
  };
  const SolveModelResult result = SolveModel(model, options, {-1, &cancel});
  EXPECT_EQ(result.summary.termination, SolveTermination::kInterrupted);
  EXPECT_EQ(result.summary.sweeps.size(), 2u);
  EXPECT_NEAR(CostOf(result.model), result.summary.cost_final, 1e-9);
  EXPECT_LT(result.summary.cost_final, result.summary.cost_initial);
}

TEST(SolveModel, GivesTheBestSoFarWhenInterruptedInAJointIteration) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  CancelFlag cancel{false};
  SolveModelOptions options;
  options.joint.callback = [&](int iteration, const JointIteration&) {
    if (iteration == 3) cancel = true;
  };
  const SolveModelResult result = SolveModel(model, options, {-1, &cancel});
  EXPECT_EQ(result.summary.termination, SolveTermination::kInterrupted);
  EXPECT_NEAR(CostOf(result.model), result.summary.cost_final, 1e-9);
}

// A legacy scene whose first image has no translation.
struct PoselessScene {
  PoselessScene() {
    SceneOptions scene = NoisyScene();
    scene.has_rigs = false;
    model = SynthesizeScene(scene).model;
    cost = SolveModel(model, {}).summary.cost_final;
    model.frames[0].rig_from_world.translation.setConstant(
        std::numeric_limits<double>::quiet_NaN());
    for (const TrackElement& element : model.track_elements) {
      num_observations += element.image_id == model.images[0].id;
    }
  }

  Model model;
  double cost = 0;               // the optimum of all observations
  int64_t num_observations = 0;  // of the image
};

TEST(SolveModel, IsInterruptedOnItsWayToAStart) {
  const Model model = SynthesizeScene({}).model;
  SolveModelOptions options;
  options.init = SolveInit::kFeasible;
  CancelFlag is_cancelled = false;
  options.joint.callback = [&](int iteration, const JointIteration& state) {
    EXPECT_TRUE(state.target);
    if (iteration == 2) is_cancelled = true;
  };
  const SolveModelResult result =
      SolveModel(model, options, {-1, &is_cancelled});
  EXPECT_EQ(result.summary.termination, SolveTermination::kInterrupted);
  EXPECT_EQ(result.summary.iterations.size(), 2u);
  EXPECT_FALSE(result.summary.num_working_observations);
  EXPECT_THAT(result.model, IsModel(model));
}

TEST(SolveModel, StartsFromNothingWhereTheModelLeavesObservationsOut) {
  const PoselessScene scene;
  SolveModelOptions options;
  std::vector<std::string> notes;
  Context context;
  context.on_note = [&](const std::string& note) { notes.push_back(note); };
  const SolveModelResult result = SolveModel(scene.model, options, context);
  EXPECT_EQ(result.summary.init, SolveInit::kFeasible);
  EXPECT_THAT(result.summary.left_out, ::testing::Each(0));
  EXPECT_NEAR(result.summary.cost_final, scene.cost, 2e-4 * scene.cost);
  EXPECT_EQ(result.summary.pixel_error_after.not_finite, 0);
  EXPECT_THAT(notes, ::testing::ElementsAre(
                         ::testing::HasSubstr("looking for a start")));
}

TEST(SolveModel, GoesOnWithoutTheObservationsThatNoStartCanServe) {
  const PoselessScene scene;
  SolveModelOptions options;
  options.init_max_error = 0.1;
  const SolveModelResult result = SolveModel(scene.model, options);
  EXPECT_EQ(result.summary.init, SolveInit::kModel);
  EXPECT_EQ(result.summary.termination, SolveTermination::kGapReached);
  EXPECT_GE(result.summary.left_out[static_cast<int>(LeftOut::kNoPose)],
            scene.num_observations);
}

TEST(SolveModel, KeepsAnImageWithoutPoseInSweepsAloneAndSaysWhatHelps) {
  const PoselessScene scene;
  SolveModelOptions options;
  options.method = SolveMethod::kResInt;
  std::vector<std::string> notes;
  Context context;
  context.on_note = [&](const std::string& note) { notes.push_back(note); };
  const SolveModelResult result = SolveModel(scene.model, options, context);
  EXPECT_EQ(result.summary.left_out[static_cast<int>(LeftOut::kNoPose)],
            scene.num_observations);
  EXPECT_EQ(result.summary.pixel_error_after.not_finite,
            scene.num_observations);
  EXPECT_THAT(result.model, IsModel(scene.model, kWhatASolveChanges));
  EXPECT_THAT(notes, ::testing::ElementsAre(
                         ::testing::HasSubstr("--Solver.init feasible")));
}

TEST(SolveModel, StartsFromNothingWhereAllCamerasStandInOnePlace) {
  SceneOptions scene = NoisyScene();
  scene.has_rigs = false;
  Model model = SynthesizeScene(scene).model;
  const double cost = SolveModel(model, {}).summary.cost_final;
  for (Frame& frame : model.frames) {
    frame.rig_from_world.translation.setZero();
  }
  const SolveSummary summary = SolveModel(model, {}).summary;
  EXPECT_EQ(summary.init, SolveInit::kFeasible);
  EXPECT_NEAR(summary.cost_final, cost, 2e-4 * cost);
}

TEST(TriangulateModel, MovesPointsOnlyAndLowersTheLargestErrorOfEveryTrack) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  const SolveModelResult result = TriangulateModel(model, {});
  Ignoring points;
  points.coordinates = true;
  points.point_errors = true;
  EXPECT_THAT(result.model, IsModel(model, points));

  const std::vector<double> before_px = PixelErrors(model);
  const std::vector<double> after_px = PixelErrors(result.model);
  for (const Point3D& point : model.points3D) {
    const auto largest = [&point](const std::vector<double>& errors_px) {
      return *std::max_element(errors_px.begin() + point.track_begin,
                               errors_px.begin() + point.track_end);
    };
    EXPECT_LE(largest(after_px), (1 + 1e-12) * largest(before_px));
  }
}

TEST(TriangulateModel, IsDoneAfterOneSweepOfPinholes) {
  SceneOptions scene = NoisyScene();
  scene.camera_model_id = 1;
  const Model model = SynthesizeScene(scene).model;
  const SolveModelResult once = TriangulateModel(model, {});
  const SolveModelResult twice = TriangulateModel(once.model, {});
  EXPECT_EQ(once.summary.sweeps.size(), 1u);
  EXPECT_NEAR(twice.summary.cost_final, once.summary.cost_final,
              1e-9 * once.summary.cost_final);
}

TEST(TriangulateModel, TakesOneSweepPerRoundUntilNothingIsToBeGained) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  const SolveModelResult once = TriangulateModel(model, {});
  const SolveModelResult twice = TriangulateModel(once.model, {});
  EXPECT_GT(once.summary.rounds.size(), 1u);
  EXPECT_EQ(once.summary.sweeps.size(), once.summary.rounds.size());
  EXPECT_NEAR(twice.summary.cost_final, once.summary.cost_final,
              1e-5 * once.summary.cost_final);
}

}  // namespace
}  // namespace krot::internal
