#include "krot/problem/gauge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "krot/problem/cost.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// C = -R' (R_sr t_f + t_sr), one per view.
std::vector<Vector3d> Centres(const KnownRotationProblem& problem,
                              const Estimate& estimate) {
  std::vector<Vector3d> centres;
  for (const View& view : problem.views) {
    centres.push_back(
        -view.cam_from_world_rotation.transpose() *
        (view.cam_from_rig_rotation * estimate.translations[view.frame] +
         view.cam_from_rig_translation));
  }
  return centres;
}

Vector3d Centroid(const std::vector<Vector3d>& positions) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& x : positions) sum += x;
  return sum / static_cast<double>(positions.size());
}

double Rms(const std::vector<Vector3d>& positions) {
  const Vector3d centroid = Centroid(positions);
  double sum = 0;
  for (const Vector3d& x : positions) sum += (x - centroid).squaredNorm();
  return std::sqrt(sum / static_cast<double>(positions.size()));
}

void ExpectSameCentroid(const std::vector<Vector3d>& a,
                        const std::vector<Vector3d>& b) {
  EXPECT_NEAR((Centroid(a) - Centroid(b)).norm(), 0, 1e-12);
}

void ExpectSameCentroidAndRms(const std::vector<Vector3d>& a,
                              const std::vector<Vector3d>& b) {
  ExpectSameCentroid(a, b);
  EXPECT_NEAR(Rms(a), Rms(b), 1e-12);
}

// s -> scale s + shift for the whole scene. Exact for coincident views.
Estimate Moved(const KnownRotationProblem& problem, Estimate estimate,
               double scale, const Vector3d& shift) {
  for (const View& view : problem.views) {
    if (view.cam_from_rig_rotation != Matrix3d::Identity()) continue;
    Vector3d& t = estimate.translations[view.frame];
    t = scale * t - view.cam_from_world_rotation * shift;
  }
  for (Vector3d& point : estimate.points) point = scale * point + shift;
  return estimate;
}

// Everything a little elsewhere, as after a solve.
Estimate Perturbed(Estimate estimate) {
  double phase = 0;
  const auto wobble = [&phase] {
    phase += 1;
    return Vector3d(std::sin(phase), std::cos(phase), std::sin(2 * phase));
  };
  for (Vector3d& t : estimate.translations) t += 0.01 * wobble();
  for (Vector3d& point : estimate.points) point += 0.02 * wobble();
  return estimate;
}

double L2Cost(const RandomScene& scene, const Estimate& estimate) {
  return Cost(scene.problem, estimate, Norm::L2(), 1);
}

TEST(RestoreGauge, UndoesAMove) {
  const RandomScene scene = MakeRandomScene({});
  Estimate moved = Moved(scene.problem, scene.estimate, 3, {10, -20, 30});
  RestoreGauge(scene.problem, scene.estimate, &moved);
  for (size_t f = 0; f < moved.translations.size(); ++f) {
    EXPECT_NEAR((moved.translations[f] - scene.estimate.translations[f]).norm(),
                0, 1e-12);
  }
  for (size_t k = 0; k < moved.points.size(); ++k) {
    EXPECT_NEAR((moved.points[k] - scene.estimate.points[k]).norm(), 0, 1e-12);
  }
}

TEST(RestoreGauge, OfTheReferenceChangesNoBit) {
  const RandomScene scene = MakeRandomScene({});
  Estimate restored = scene.estimate;
  RestoreGauge(scene.problem, scene.estimate, &restored);
  EXPECT_EQ(restored.translations, scene.estimate.translations);
  EXPECT_EQ(restored.points, scene.estimate.points);
}

TEST(RestoreGauge, KeepsCentroidAndSpreadOfTheCentresAndTheCost) {
  const RandomScene scene = MakeRandomScene({});
  const Estimate solved =
      Moved(scene.problem, Perturbed(scene.estimate), 0.5, {1, 2, 3});
  Estimate restored = solved;
  RestoreGauge(scene.problem, scene.estimate, &restored);
  ExpectSameCentroidAndRms(Centres(scene.problem, restored),
                           Centres(scene.problem, scene.estimate));
  EXPECT_NEAR(L2Cost(scene, restored), L2Cost(scene, solved), 1e-9);
}

TEST(RestoreGauge, OfARigWithABaselineKeepsItsScaleAsSolved) {
  RandomSceneOptions options;
  options.views_per_frame = 2;
  options.baseline = 0.3;
  const RandomScene scene = MakeRandomScene(options);
  const Estimate solved =
      Moved(scene.problem, Perturbed(scene.estimate), 1, {1, 2, 3});
  Estimate restored = solved;
  RestoreGauge(scene.problem, scene.estimate, &restored);
  const std::vector<Vector3d> centres = Centres(scene.problem, restored);
  ExpectSameCentroid(centres, Centres(scene.problem, scene.estimate));
  EXPECT_NEAR(Rms(centres), Rms(Centres(scene.problem, solved)), 1e-12);
  EXPECT_NEAR(L2Cost(scene, restored), L2Cost(scene, solved), 1e-9);
}

TEST(RestoreGauge, OfARigWithoutABaselineScales) {
  RandomSceneOptions options;
  options.views_per_frame = 3;
  const RandomScene scene = MakeRandomScene(options);
  const Estimate solved =
      Moved(scene.problem, Perturbed(scene.estimate), 2, {1, 2, 3});
  Estimate restored = solved;
  RestoreGauge(scene.problem, scene.estimate, &restored);
  ExpectSameCentroidAndRms(Centres(scene.problem, restored),
                           Centres(scene.problem, scene.estimate));
  EXPECT_NEAR(L2Cost(scene, restored), L2Cost(scene, solved), 1e-9);
}

TEST(RestoreGauge, ScalesIfEveryFrameSeesThroughOneCentreOffItsOrigin) {
  // Only the second camera of each rig sees points: the baseline is no ruler.
  RandomSceneOptions options;
  options.views_per_frame = 2;
  options.baseline = 0.3;
  RandomScene scene = MakeRandomScene(options);
  std::vector<Observation> kept;
  for (const Observation& observation : scene.problem.observations) {
    if (observation.view >= options.num_frames) kept.push_back(observation);
  }
  scene.problem.observations = kept;
  scene.problem.views.erase(scene.problem.views.begin(),
                            scene.problem.views.begin() + options.num_frames);
  for (Observation& observation : scene.problem.observations) {
    observation.view -= options.num_frames;
  }
  IndexObservations(&scene.problem);

  const Estimate solved = Perturbed(scene.estimate);
  Estimate restored = solved;
  RestoreGauge(scene.problem, scene.estimate, &restored);
  const std::vector<Vector3d> wanted = Centres(scene.problem, scene.estimate);
  EXPECT_GT(std::abs(Rms(Centres(scene.problem, solved)) - Rms(wanted)), 1e-6);
  ExpectSameCentroidAndRms(Centres(scene.problem, restored), wanted);
  EXPECT_NEAR(L2Cost(scene, restored), L2Cost(scene, solved), 1e-9);
}

double MedianDistance(const std::vector<Vector3d>& points,
                      const Vector3d& from) {
  std::vector<double> distances;
  for (const Vector3d& x : points) distances.push_back((x - from).norm());
  std::sort(distances.begin(), distances.end());
  return distances[(distances.size() - 1) / 2];
}

TEST(RestoreGauge, KeepsHowFarAwayPointsAreWhereAllCentresCoincide) {
  RandomScene scene = MakeRandomScene({});
  const Vector3d centre(7, 8, -1);
  for (const View& view : scene.problem.views) {
    scene.estimate.translations[view.frame] =
        -view.cam_from_world_rotation * centre;
  }
  Estimate solved =
      Moved(scene.problem, Perturbed(scene.estimate), 3, {4, 5, 6});
  solved.points[0] *= 1e8;  // no depth is determined
  Estimate restored = solved;
  RestoreGauge(scene.problem, scene.estimate, &restored);
  const std::vector<Vector3d> centres = Centres(scene.problem, restored);
  ExpectSameCentroid(centres, {centre});
  EXPECT_NEAR(MedianDistance(restored.points, Centroid(centres)),
              MedianDistance(scene.estimate.points, centre), 1e-12);
}

// The centres of all frames but the second.
std::vector<Vector3d> CentresOfOthers(const RandomScene& scene,
                                      const Estimate& estimate) {
  std::vector<Vector3d> centres = Centres(scene.problem, estimate);
  centres.erase(centres.begin() + 1);
  return centres;
}

TEST(RestoreGauge, IsThatOfTheOthersWhereACameraRunsAway) {
  const RandomScene scene = MakeRandomScene({});
  for (const auto& [from, to] :
       {std::pair{1.0, 1e9}, {1e5, 1e9}, {1e5, 1.0}, {40.0, 1.0}}) {
    Estimate reference = scene.estimate;
    Estimate solved = Perturbed(scene.estimate);
    reference.translations[1] *= from;
    solved.translations[1] *= to;
    solved = Moved(scene.problem, solved, 0.5, {1, 2, 3});
    Estimate restored = solved;
    RestoreGauge(scene.problem, reference, &restored);
    ExpectSameCentroidAndRms(CentresOfOthers(scene, restored),
                             CentresOfOthers(scene, reference));
    std::vector<char> expected(scene.problem.num_frames, 1);
    expected[1] = 0;
    EXPECT_EQ(FindHeldFrames(scene.problem, reference, solved), expected);
  }
}

TEST(FindHeldFrames, LeavesOutWhatIsLooseUnlessAllAre) {
  const RandomScene scene = MakeRandomScene({});
  const Estimate solved = Perturbed(scene.estimate);
  std::vector<char> is_loose(scene.problem.num_frames, 0);
  is_loose[3] = 1;
  std::vector<char> expected(scene.problem.num_frames, 1);
  expected[3] = 0;
  EXPECT_EQ(FindHeldFrames(scene.problem, scene.estimate, solved, is_loose),
            expected);
  EXPECT_EQ(FindHeldFrames(scene.problem, scene.estimate, solved,
                           std::vector<char>(scene.problem.num_frames, 1)),
            std::vector<char>(scene.problem.num_frames, 1));
}

TEST(RestoreGauge, IsNotMisledByAPointNearInfinity) {
  RandomScene scene = MakeRandomScene({});
  scene.estimate.points[0] *= 1e14;
  Estimate restored =
      Moved(scene.problem, Perturbed(scene.estimate), 3, {4, 5, 6});
  RestoreGauge(scene.problem, scene.estimate, &restored);
  ExpectSameCentroidAndRms(Centres(scene.problem, restored),
                           Centres(scene.problem, scene.estimate));
}

TEST(RestoreGauge, OnlyTranslatesAComponentOfOneFrameAndOnePoint) {
  RandomSceneOptions options = {1, 1};
  const RandomScene scene = MakeRandomScene(options);
  Estimate restored = Moved(scene.problem, scene.estimate, 1, {4, 5, 6});
  RestoreGauge(scene.problem, scene.estimate, &restored);
  EXPECT_NEAR((restored.points[0] - scene.estimate.points[0]).norm(), 0, 1e-12);
  EXPECT_NEAR(
      (restored.translations[0] - scene.estimate.translations[0]).norm(), 0,
      1e-12);
}

TEST(RestoreGauge, MovesEachComponentOnItsOwn) {
  // Two scenes side by side, moved differently.
  RandomScene scene = MakeRandomScene({});
  const RandomScene other = MakeRandomScene({4, 10, 1, 0, /*seed=*/9});
  Estimate moved = Moved(scene.problem, scene.estimate, 2, {1, 1, 1});
  const Estimate other_moved =
      Moved(other.problem, other.estimate, 5, {-3, 0, 3});

  KnownRotationProblem& problem = scene.problem;
  const int32_t first_frame = problem.num_frames;
  const int32_t first_view = static_cast<int32_t>(problem.views.size());
  const int32_t first_point = problem.num_points;
  for (View view : other.problem.views) {
    view.frame += first_frame;
    problem.views.push_back(view);
  }
  for (Observation observation : other.problem.observations) {
    observation.view += first_view;
    observation.point += first_point;
    problem.observations.push_back(observation);
  }
  problem.num_frames += other.problem.num_frames;
  problem.num_points += other.problem.num_points;
  IndexObservations(&problem);
  const auto append = [](Estimate* estimate, const Estimate& tail) {
    estimate->translations.insert(estimate->translations.end(),
                                  tail.translations.begin(),
                                  tail.translations.end());
    estimate->points.insert(estimate->points.end(), tail.points.begin(),
                            tail.points.end());
  };
  append(&scene.estimate, other.estimate);
  append(&moved, other_moved);

  RestoreGauge(problem, scene.estimate, &moved);
  for (size_t f = 0; f < moved.translations.size(); ++f) {
    EXPECT_NEAR((moved.translations[f] - scene.estimate.translations[f]).norm(),
                0, 1e-12);
  }
  for (size_t k = 0; k < moved.points.size(); ++k) {
    EXPECT_NEAR((moved.points[k] - scene.estimate.points[k]).norm(), 0, 1e-12);
  }
}

TEST(RestoreGauge, LeavesFramesAndPointsWithoutObservationsWhereTheyAre) {
  RandomScene scene = MakeRandomScene({});
  scene.problem.num_frames += 1;
  scene.problem.num_points += 1;
  IndexObservations(&scene.problem);
  scene.estimate.translations.push_back({1, 2, 3});
  scene.estimate.points.push_back({4, 5, 6});
  Estimate moved = scene.estimate;
  for (Vector3d& t : moved.translations) t *= 2;
  for (Vector3d& s : moved.points) s *= 2;
  RestoreGauge(scene.problem, scene.estimate, &moved);
  EXPECT_EQ(moved.translations.back(), Vector3d(2, 4, 6));
  EXPECT_EQ(moved.points.back(), Vector3d(8, 10, 12));
  EXPECT_NEAR((moved.points[0] - scene.estimate.points[0]).norm(), 0, 1e-12);
}

// Centres of the frames and a point, wanted within half a unit of where they
// are, each in an ellipsoid of its own.
std::vector<WantedPlace> PlacesAround(const RandomScene& scene,
                                      const Estimate& at) {
  std::mt19937 generator(5);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  std::vector<WantedPlace> places;
  const std::vector<Vector3d> now = Centres(scene.problem, at);
  const std::vector<Vector3d> wanted = Centres(scene.problem, scene.estimate);
  const auto add = [&](int32_t frame, int32_t point, const Vector3d& x,
                       const Vector3d& centre) {
    const Vector3d off(uniform(generator), uniform(generator),
                       uniform(generator));
    places.push_back({frame, point, x, centre + off,
                      Vector3d(1, 2, 3 + off.x()).asDiagonal()});
  };
  for (size_t v = 0; v < now.size(); ++v) {
    add(scene.problem.views[v].frame, -1, now[v], wanted[v]);
  }
  add(-1, 3, at.points[3], scene.estimate.points[3]);
  return places;
}

double LargestRatio(const RandomScene& scene, const Estimate& estimate,
                    const std::vector<WantedPlace>& places) {
  const std::vector<Vector3d> centres = Centres(scene.problem, estimate);
  double largest = 0;
  for (size_t n = 0; n < places.size(); ++n) {
    const WantedPlace& place = places[n];
    const Vector3d& x =
        place.frame >= 0 ? centres[n] : estimate.points[place.point];
    largest =
        std::max(largest, (place.unit_from_world * (x - place.centre)).norm());
  }
  return largest;
}

// The largest ratio is convex in the move, so where no small move lowers it by
// much, no move does.
TEST(MoveToPlaces, LeavesAMoveThatHardlyAnySmallOneImproves) {
  const RandomScene scene = MakeRandomScene({});
  const Estimate far = Moved(scene.problem, scene.estimate, 3, {10, -20, 5});
  const std::vector<WantedPlace> places = PlacesAround(scene, far);
  Estimate moved = far;
  MoveToPlaces(scene.problem, places, &moved);
  const double largest = LargestRatio(scene, moved, places);
  EXPECT_LT(largest, 0.1 * LargestRatio(scene, far, places));
  EXPECT_NEAR(Cost(scene.problem, moved, Norm::L2(), 1),
              Cost(scene.problem, far, Norm::L2(), 1), 1e-9);

  std::mt19937 generator(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int trial = 0; trial < 10000; ++trial) {
    const double size = std::pow(10, -1.5 + 1.5 * uniform(generator));
    const double scale = std::exp(size * uniform(generator));
    const Vector3d shift(uniform(generator), uniform(generator),
                         uniform(generator));
    ASSERT_GT(
        LargestRatio(scene, Moved(scene.problem, moved, scale, size * shift),
                     places),
        0.98 * largest);
  }
}

TEST(MoveToPlaces, KeepsTheScaleThatABaselineHoldsAndWhatIsFixed) {
  const RandomScene rigs = MakeRandomScene({5, 20, 2, 0.3});
  Estimate moved = rigs.estimate;
  for (Vector3d& t : moved.translations) t *= 2;
  const Estimate far = moved;
  const std::vector<WantedPlace> places = PlacesAround(rigs, far);
  MoveToPlaces(rigs.problem, places, &moved);
  EXPECT_LT(LargestRatio(rigs, moved, places), LargestRatio(rigs, far, places));
  EXPECT_NEAR((moved.points[0] - moved.points[1]).norm(),
              (far.points[0] - far.points[1]).norm(), 1e-12);

  RandomScene fixed = MakeRandomScene({});
  fixed.problem.fixed_points.resize(fixed.problem.num_points);
  fixed.problem.fixed_points[2] = fixed.estimate.points[2];
  Estimate same = fixed.estimate;
  MoveToPlaces(fixed.problem, PlacesAround(fixed, same), &same);
  EXPECT_EQ(same.points, fixed.estimate.points);
  EXPECT_EQ(same.translations, fixed.estimate.translations);
}

TEST(RestoreGaugeIfHarmless, DoesTheSameWhereNothingIsLost) {
  const RandomScene scene = MakeRandomScene({});
  const Estimate moved =
      Moved(scene.problem, scene.estimate, 0.5, Vector3d(1, 2, 3));
  Estimate restored = moved;
  RestoreGauge(scene.problem, scene.estimate, &restored);
  Estimate estimate = moved;
  RestoreGaugeIfHarmless(scene.problem, scene.estimate, Norm::L2(), Context{1},
                         &estimate);
  EXPECT_NE(estimate.points, moved.points);
  EXPECT_EQ(estimate.points, restored.points);
  EXPECT_EQ(estimate.translations, restored.translations);
}

TEST(RestoreGaugeIfHarmless, StaysWhereCoordinatesWouldLoseTheirDigits) {
  const RandomScene scene = MakeRandomScene({});
  const double cost = Cost(scene.problem, scene.estimate, Norm::L2(), 1);
  // 1e13 away, coordinates are multiples of 2e-3, a pixel and more.
  const Estimate far =
      Moved(scene.problem, scene.estimate, 1, Vector3d(1e13, -1e13, 1e13));
  Estimate restored = scene.estimate;
  RestoreGauge(scene.problem, far, &restored);
  ASSERT_GT(Cost(scene.problem, restored, Norm::L2(), 1), (1 + 1e-8) * cost);
  Estimate estimate = scene.estimate;
  RestoreGaugeIfHarmless(scene.problem, far, Norm::L2(), Context{1}, &estimate);
  EXPECT_EQ(estimate.points, scene.estimate.points);
  EXPECT_EQ(estimate.translations, scene.estimate.translations);
}

}  // namespace
}  // namespace krot::internal
