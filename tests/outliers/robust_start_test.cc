#include "krot/outliers/robust_start.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "krot/analysis/model_comparison.h"
#include "krot/model/rigs.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/outliers/parts.h"
#include "krot/problem/cost.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"
#include "tests/testing/weakly_tied.h"

namespace krot::internal {
namespace {

SceneOptions Scene(double outlier_ratio, double rotation_noise_deg) {
  SceneOptions options = SceneOf(12, 400, 5, 0.5, 5);
  options.camera_model_id = 1;
  options.outlier_ratio = outlier_ratio;
  options.rotation_noise_deg = rotation_noise_deg;
  return options;
}

// Without any translation or point.
Model Wiped(Model model) {
  for (Frame& frame : model.frames) {
    frame.rig_from_world.translation.setConstant(std::nan(""));
  }
  for (Image& image : model.images) {
    image.cam_from_world.translation.setConstant(std::nan(""));
  }
  for (Point3D& point : model.points3D) point.xyz.setZero();
  return model;
}

// RMS distance of the camera centres, after the similarity that fits them
// best, by the radius of the truth.
double CentreError(const Model& truth, const Model& model) {
  const std::vector<ImageGeometry> of_truth = ImageGeometries(truth);
  const std::vector<ImageGeometry> of_model = ImageGeometries(model);
  std::vector<PosePair> poses(of_truth.size());
  for (size_t n = 0; n < poses.size(); ++n) {
    poses[n].center1 = Center(of_truth[n].cam_from_world);
    poses[n].center2 = Center(of_model[n].cam_from_world);
  }
  const std::optional<Similarity> fit = AlignCenters(poses);
  if (!fit) return INFINITY;
  double sum = 0;
  for (const PosePair& pose : poses) {
    sum += (*fit * pose.center2 - pose.center1).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(poses.size())) /
         SceneRadius(poses);
}

Model AtRobustStart(const Model& model) {
  BuildProblemOptions build;
  build.ignore_translations = true;
  const BuiltProblem built = BuildProblem(model, build);
  return ApplyEstimate(model, built,
                       FindRobustStart(built.problem, Norm::L2(), 2, {}));
}

TEST(FindRobustStart, PutsTheCamerasNearTheTruthWhateverTheOutliers) {
  for (const double ratio : {0.0, 0.01, 0.05, 0.1, 0.2}) {
    const SyntheticScene scene = SynthesizeScene(Scene(ratio, 0));
    EXPECT_LT(
        CentreError(scene.ground_truth, AtRobustStart(Wiped(scene.model))),
        0.01)
        << ratio;
  }
}

TEST(FindRobustStart, LosesNoMoreThanTheRotationsAreOff) {
  for (const double degrees : {0.1, 0.5, 1.0}) {
    const SyntheticScene scene = SynthesizeScene(Scene(0.05, degrees));
    EXPECT_LT(
        CentreError(scene.ground_truth, AtRobustStart(Wiped(scene.model))),
        3 * degrees * M_PI / 180)
        << degrees;
  }
}

TEST(FindRobustStart, KeepsTheBaselinesOfARig) {
  SceneOptions options = Scene(0.05, 0);
  options.sensors_per_rig = 2;
  options.rig_baseline = 0.1;
  const SyntheticScene scene = SynthesizeScene(options);
  Model model = Wiped(scene.model);
  for (Image& image : model.images) {
    image.cam_from_world.translation.setZero();
  }
  EXPECT_LT(CentreError(scene.ground_truth, AtRobustStart(model)), 0.02);
}

// So many that they are not placed all at once.
TEST(FindRobustStart, PlacesManyCamerasThatSeeEachOthersPoints) {
  SceneOptions options = Scene(0.1, 0);
  options.layout = SceneLayout::kOrbit;
  options.num_frames = 320;
  options.num_points = 4600;
  options.track_length = 8;
  const SyntheticScene scene = SynthesizeScene(options);
  EXPECT_LT(CentreError(scene.ground_truth, AtRobustStart(Wiped(scene.model))),
            0.01);
}

// 24 cameras on a circle, or along a path, in parts.
SceneOptions SceneInParts(SceneLayout layout) {
  SceneOptions options = Scene(0.05, 0);
  options.layout = layout;
  options.num_frames = 24;
  options.num_points = 1500;
  options.track_length = layout == SceneLayout::kOrbit ? 12 : 6;
  return options;
}

KnownRotationProblem ProblemOf(const Model& model) {
  BuildProblemOptions build;
  build.ignore_translations = true;
  return BuildProblem(model, build).problem;
}

// Which part an image is of, and which parts are tied.
struct Ties {
  SceneLayout layout;
  int num_parts;
  std::function<int(int)> part_of;
  std::function<bool(int, int)> are_tied;
};

const Ties kTwoParts = {SceneLayout::kStreet, 2, [](int n) { return n / 12; },
                        [](int, int) { return true; }};
const Ties kChain = {SceneLayout::kStreet, 3, [](int n) { return n / 8; },
                     [](int a, int b) { return b == a + 1; }};
const Ties kStar = {SceneLayout::kOrbit, 4, [](int n) { return n % 4; },
                    [](int a, int) { return a == 0; }};

TEST(FindParts, CutsWhereFewTracksCross) {
  for (const Ties& ties : {kTwoParts, kChain, kStar}) {
    const Model model = WeaklyTied(
        SynthesizeScene(SceneInParts(ties.layout)).model, ties.part_of,
        ties.are_tied, /*num_tracks=*/10, /*num_wrong=*/0);
    const std::vector<int32_t> parts = FindParts(ProblemOf(model), {});
    ASSERT_EQ(parts.size(), 24u);
    for (int n = 0; n < 24; ++n) EXPECT_EQ(parts[n], ties.part_of(n)) << n;
  }
}

// A dozen images that see all around, and four groups of three that see them.
TEST(FindParts, TakeAllSmallerGroupsThatManyTracksTie) {
  const auto part_of = [](int n) { return n % 2 == 0 ? 0 : 1 + n / 2 % 4; };
  const auto parts_with = [&](int num_tracks) {
    return NumParts(FindParts(
        ProblemOf(WeaklyTied(
            SynthesizeScene(SceneInParts(SceneLayout::kOrbit)).model, part_of,
            [](int a, int) { return a == 0; }, num_tracks, /*num_wrong=*/0)),
        {}));
  };
  EXPECT_EQ(parts_with(10), 5);
  EXPECT_EQ(parts_with(200), 1);
}

// The scales of both parts are free, if it were not for a few tracks, which may
// agree by chance.
TEST(FindParts, CutsWhereNearlyAllTracksThatCrossSeeTheSameFrame) {
  SceneOptions options = SceneInParts(SceneLayout::kStreet);
  options.num_frames = 100;
  options.num_points = 5000;
  options.track_length = 8;
  options.random_seed = 0;
  const KnownRotationProblem problem =
      ProblemOf(SynthesizeScene(options).model);
  for (const int32_t shared : {14, 20, 48, 56, 80}) {
    std::vector<char> ties(problem.observations.size());
    int num_few = 0;
    for (int32_t k = 0; k < problem.num_points; ++k) {
      bool is_across = false;
      for (const int64_t i : problem.OfPoint(k)) {
        is_across = is_across || problem.FrameOf(i) < shared;
      }
      const int32_t last = k % 16 == 0 ? shared + 3 : shared;
      bool is_beyond = false;
      for (const int64_t i : problem.OfPoint(k)) {
        ties[i] = !is_across || problem.FrameOf(i) <= last;
        is_beyond = is_beyond || (ties[i] && problem.FrameOf(i) > shared);
      }
      num_few += is_across && is_beyond;
    }
    ASSERT_GT(num_few, 0);
    ASSERT_LT(num_few, kStrongTracks);
    const std::vector<int32_t> parts = FindParts(problem, ties, {});
    for (int32_t f = 0; f < problem.num_frames; ++f) {
      EXPECT_TRUE(f == shared || parts[f] == (f > shared))
          << f << " of " << shared;
    }
  }
}

// 30 images along a path, tracks of three.
SyntheticScene ShortTracks(double outlier_ratio, uint64_t seed) {
  SceneOptions options = Scene(outlier_ratio, 0);
  options.layout = SceneLayout::kStreet;
  options.num_frames = 30;
  options.num_points = 1800;
  options.track_length = 3;
  options.random_seed = seed;
  return SynthesizeScene(options);
}

TEST(FindParts, LeavesWholeWhatManyTracksHold) {
  for (const SceneLayout layout : {SceneLayout::kOrbit, SceneLayout::kStreet}) {
    const std::vector<int32_t> parts =
        FindParts(ProblemOf(SynthesizeScene(SceneInParts(layout)).model), {});
    EXPECT_EQ(parts, std::vector<int32_t>(24, 0));
  }
  // Hardly any track is seen by two frames on either side of a cut.
  EXPECT_EQ(FindParts(ProblemOf(ShortTracks(0, 1).model), {}),
            std::vector<int32_t>(30, 0));
}

TEST(Groups, ShareTheTracksThatFramesOfBothSee) {
  const KnownRotationProblem problem =
      ProblemOf(SynthesizeScene(SceneInParts(SceneLayout::kStreet)).model);
  std::vector<int32_t> each(problem.num_frames), threes(problem.num_frames);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    each[f] = f;
    threes[f] = f % 3;
  }
  Groups groups(problem, each);
  for (const std::vector<int32_t>& group_of : {each, threes}) {
    groups.Merge(group_of);
    std::map<std::pair<int32_t, int32_t>, double> expected;
    std::vector<int64_t> num_tracks(problem.num_frames, 0);
    for (int32_t k = 0; k < problem.num_points; ++k) {
      std::map<int32_t, std::set<int32_t>> seen;  // frames of each group
      for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
           ++i) {
        const int32_t frame = problem.FrameOf(i);
        seen[group_of[frame]].insert(frame);
      }
      for (const auto& [a, frames] : seen) {
        num_tracks[a] += frames.size() >= 2 || groups.sizes()[a] == 1;
        for (const auto& [b, others] : seen) {
          if (a < b) ++expected[{a, b}];
        }
      }
    }
    std::map<std::pair<int32_t, int32_t>, double> shared;
    for (const GroupPair& pair : groups.Pairs()) {
      shared[{pair.a, pair.b}] = pair.strength;
    }
    EXPECT_EQ(shared, expected);
    const std::vector<Groups::Count> counts = groups.Counts();
    for (int32_t f = 0; f < problem.num_frames; ++f) {
      EXPECT_EQ(counts[f].num_tracks, num_tracks[f]);
    }
  }
}

// No two frames share many tracks, but each many with all others.
TEST(FindParts, IsNotMisledByGroupsWithoutTracksOfTheirOwn) {
  SceneOptions options = Scene(0, 0);
  options.layout = SceneLayout::kOrbit;
  options.num_frames = 600;
  options.num_points = 6000;
  options.track_length = 8;
  EXPECT_EQ(FindParts(ProblemOf(SynthesizeScene(options).model), {}),
            std::vector<int32_t>(600, 0));
}

TEST(FindRobustStart, HoldsTheScaleOfPartsThatTenTracksJoinHalfOfThemWrong) {
  for (const Ties& ties : {kTwoParts, kChain, kStar}) {
    for (const int num_wrong : {0, 5}) {
      const SyntheticScene scene = SynthesizeScene(SceneInParts(ties.layout));
      const Model model = WeaklyTied(Wiped(scene.model), ties.part_of,
                                     ties.are_tied, 10, num_wrong);
      EXPECT_LT(CentreError(scene.ground_truth, AtRobustStart(model)), 0.02)
          << ties.num_parts << " parts, " << num_wrong << " wrong";
    }
  }
}

// A point can go wherever a single camera sees it.
TEST(NumAgreeing, DoesNotCountWhatAgreesWithNoOtherObservation) {
  const BuiltProblem built =
      BuildProblem(SynthesizeScene(Scene(0, 0)).ground_truth, {});
  const KnownRotationProblem& problem = built.problem;
  const auto all = static_cast<int64_t>(problem.observations.size());
  const auto num_agreeing = [&](const Estimate& estimate) {
    return NumAgreeing(problem, estimate, Norm::L2(), /*cap=*/8);
  };
  EXPECT_EQ(num_agreeing(built.start), all);
  Estimate moved = built.start;
  const AffineMap first =
      CamFromWorld(problem.views[problem.observations[0].view],
                   moved.translations[problem.FrameOf(0)]);
  const Eigen::Vector3d centre =
      -first.leftCols<3>().transpose() * first.col(3);
  moved.points[0] = centre + 3 * (moved.points[0] - centre);
  EXPECT_LT(ResidualOf(ViewPoint(problem, problem.observations[0], moved),
                       Norm::L2()),
            8);
  EXPECT_EQ(num_agreeing(moved), all - problem.point_begin[1]);
}

// 200 images along a path.
TEST(FindRobustStart, JoinsAgainWhatTracksThatDisagreeDidNotHold) {
  SceneOptions options = Scene(0.3, 0.3);
  options.layout = SceneLayout::kStreet;
  options.num_frames = 200;
  options.num_points = 10000;
  options.track_length = 8;
  options.pixel_noise = 1;
  options.random_seed = 0;
  const SyntheticScene scene = SynthesizeScene(options);
  EXPECT_LT(CentreError(scene.ground_truth, AtRobustStart(Wiped(scene.model))),
            0.01);
}

TEST(FilterOutliers, TellsNoiseFromWrongObservationsInNearlyEveryTrack) {
  SceneOptions options = Scene(0.4, 0);
  options.num_points = 2000;
  options.track_length = 8;
  const SyntheticScene scene = SynthesizeScene(options);
  OutlierFilterOptions filter;
  filter.find_conflicts = false;
  const OutlierFilterResult result =
      FilterOutliers(Wiped(scene.model), filter, {});
  // What Gaussian noise of half a pixel per axis explains, and a third more.
  EXPECT_LT(result.summary.max_error,
            1.3 * 0.5 * std::sqrt(2 * std::log(16000 / 0.05)));
  EXPECT_GT(result.summary.max_error, 0.5 * std::sqrt(2 * std::log(16000)));
  EXPECT_LT(CentreError(scene.ground_truth, result.model), 0.005);
}

// As matches of pairs of images are before they are chained: all parts are
// untied, and hardly have a scale to be joined by.
TEST(FindRobustStart, ExplainsTracksOfTwo) {
  SceneOptions options = Scene(0.1, 0.3);
  options.layout = SceneLayout::kStreet;
  options.num_frames = 100;
  options.num_points = 5000;
  options.track_length = 2;
  const KnownRotationProblem problem =
      ProblemOf(SynthesizeScene(options).model);
  const Norm norm = Norm::L2();
  EXPECT_LT(MedianError(problem, FindRobustStart(problem, norm, 4, {}), norm),
            4);
}

// All of a pair's error may be that of one observation: half of the errors are
// zero, and so is their median.
TEST(FindRobustStart, FindsThePositionsOfTracksOfTwo) {
  SceneOptions options = SceneOf(12, 1000, 2, 0.5);
  options.camera_model_id = 1;
  options.outlier_ratio = 0.2;
  const SyntheticScene scene = SynthesizeScene(options);
  EXPECT_LT(CentreError(scene.ground_truth, AtRobustStart(Wiped(scene.model))),
            0.01);
}

TEST(FindWeakLinks, SaysThatTracksLeftOutHoldNothing) {
  SceneOptions options = SceneInParts(SceneLayout::kStreet);
  options.outlier_ratio = 0;
  options.num_points = 400;
  const BuiltProblem built =
      BuildProblem(SynthesizeScene(options).ground_truth, {});
  const KnownRotationProblem& problem = built.problem;
  const auto part_of = [&](int64_t i) { return problem.FrameOf(i) / 12; };
  std::vector<char> kept;
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    const auto own = static_cast<int64_t>(i);
    const int32_t k = problem.observations[i].point;
    kept.push_back(part_of(own) == part_of(problem.point_begin[k]));
  }
  Estimate torn = built.start;
  for (int32_t f = 12; f < 24; ++f) torn.translations[f] *= 0.1;
  const std::vector<char> all(kept.size(), 1);
  EXPECT_TRUE(FindWeakLinks(problem, torn, all, 8, {}).empty());
  const std::vector<WeakLink> links = FindWeakLinks(problem, torn, kept, 8, {});
  ASSERT_EQ(links.size(), 1u);
  EXPECT_FALSE(links[0].IsHeld());
  EXPECT_EQ(links[0].frames.size(), 12u);
  EXPECT_GT(links[0].scale_factor, 5);
}

// No track of two says how large a group of frames is, but all of them do.
TEST(FindWeakLinks, AreHeldByManyTracksOfTwo) {
  SceneOptions options = Scene(0, 0);
  options.num_frames = 40;
  options.num_points = 4000;
  options.track_length = 2;
  const BuiltProblem built =
      BuildProblem(SynthesizeScene(options).ground_truth, {});
  const auto all_are_held = [&](const Estimate& estimate) {
    const std::vector<char> all(built.problem.observations.size(), 1);
    const std::vector<WeakLink> links =
        FindWeakLinks(built.problem, estimate, all, 8, {});
    EXPECT_GT(links.size(), 1u);
    return std::all_of(links.begin(), links.end(),
                       [](const WeakLink& link) { return link.IsHeld(); });
  };
  EXPECT_TRUE(all_are_held(built.start));
  Estimate torn = built.start;
  for (int32_t f = 0; f < 10; ++f) torn.translations[f] *= 1.5;
  EXPECT_FALSE(all_are_held(torn));
}

// A group may grow about the only one of its frames that sees the others'
// points, however many these are.
TEST(PlaceSearch, KnowsNoScaleAboutASingleFrame) {
  SceneOptions options = SceneOf(12, 2000, 6);
  options.camera_model_id = 1;
  const BuiltProblem built =
      BuildProblem(SynthesizeScene(options).ground_truth, {});
  const KnownRotationProblem& problem = built.problem;
  const auto deviation = [&](int32_t last_of_b) {
    const std::vector<AffineMap> cameras =
        CamerasFromWorld(problem, built.start.translations);
    std::vector<SharedTrack> tracks;
    for (int32_t k = 0; k < problem.num_points; ++k) {
      SharedTrack track;
      for (const int64_t i : problem.OfPoint(k)) {
        const bool is_of_b = problem.FrameOf(i) <= last_of_b;
        (is_of_b ? track.b : track.a).observations.push_back(i);
      }
      for (Side* side : {&track.a, &track.b}) {
        side->x = built.start.points[k];
        side->H = NormalOf(problem, cameras, *side, side->x).H;
      }
      if (track.a.observations.empty() || track.b.observations.empty())
        continue;
      tracks.push_back(track);
    }
    EXPECT_GT(tracks.size(), 100u);
    return PlaceSearch(problem, built.start, 2, tracks).ScaleDeviation(Place());
  };
  EXPECT_LT(deviation(5), 0.1);
  EXPECT_EQ(deviation(0), INFINITY);
}

// Some 10^12 triples of these are never counted one by one.
TEST(PlaceSearch, FindsATurnByAFewOfAnyNumberOfTracks) {
  const BuiltProblem built =
      BuildProblem(SynthesizeScene(SceneOf(12, 2000, 6)).ground_truth, {});
  const KnownRotationProblem& problem = built.problem;
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem, built.start.translations);
  std::vector<SharedTrack> tracks;
  while (tracks.size() < 20000) {
    for (int32_t k = 0; k < problem.num_points; ++k) {
      SharedTrack track;
      for (const int64_t i : problem.OfPoint(k)) {
        (problem.FrameOf(i) % 2 == 0 ? track.a : track.b)
            .observations.push_back(i);
      }
      if (std::min(track.a.observations.size(), track.b.observations.size()) <
          2) {
        continue;
      }
      for (Side* side : {&track.a, &track.b}) {
        side->x = built.start.points[k];
        side->H = NormalOf(problem, cameras, *side, side->x).H;
      }
      tracks.push_back(track);
    }
  }
  const PlaceSearch search(problem, built.start, 2, std::move(tracks));
  const std::optional<Place> place = search.ProposeTurned();
  ASSERT_TRUE(place);
  EXPECT_NEAR(place->scale, 1, 1e-6);
  EXPECT_NEAR((place->rotation - Eigen::Matrix3d::Identity()).norm(), 0, 1e-6);
}

// A fifth of the tracks has no wrong observation.
TEST(FindWeakLinks, AreHeldWhereAsManyTracksAreWrongElsewhere) {
  int num_links = 0;
  for (const uint64_t seed : {1u, 2u, 3u}) {
    const BuiltProblem built = BuildProblem(ShortTracks(0.5, seed).model, {});
    const KnownRotationProblem& problem = built.problem;
    std::vector<char> kept;
    for (const Observation& o : problem.observations) {
      kept.push_back(
          ResidualOf(ViewPoint(problem, o, built.start), Norm::L2()) < 8);
    }
    for (const WeakLink& link :
         FindWeakLinks(problem, built.start, kept, 8, {})) {
      num_links += 2 * link.num_agreeing < link.num_telling;
      EXPECT_TRUE(link.IsHeld())
          << link.num_agreeing << " of " << link.num_telling;
    }
  }
  EXPECT_GT(num_links, 0);
}

TEST(FilterOutliers, SaysHowWellFewTracksHoldTheScale) {
  const auto scale_factors = [](int num_tracks, int num_wrong) {
    const SyntheticScene scene =
        SynthesizeScene(SceneInParts(kTwoParts.layout));
    OutlierFilterOptions options;
    options.max_error = 3;
    options.find_conflicts = false;
    const OutlierFilterResult result =
        FilterOutliers(WeaklyTied(Wiped(scene.model), kTwoParts.part_of,
                                  kTwoParts.are_tied, num_tracks, num_wrong),
                       options, {});
    EXPECT_EQ(result.summary.weak_parts.size(), 1u);
    const WeakPart& part = result.summary.weak_parts.at(0);
    EXPECT_EQ(part.image_names.size(), 12u);
    EXPECT_EQ(part.num_tracks, num_tracks);
    return part;
  };
  const WeakPart good = scale_factors(30, 0);
  EXPECT_TRUE(good.is_held);
  EXPECT_GE(good.num_agreeing, 25);
  EXPECT_LT(good.scale_factor, 1.1);
  EXPECT_FALSE(scale_factors(10, 10).is_held);
  EXPECT_FALSE(scale_factors(1, 0).is_held);
}

// Two sides of a path that share no track, but both the camera in between, of
// which any scale fits.
Model Hinged(const SceneOptions& options) {
  const Model model = SynthesizeScene(options).model;
  const ImageId hinge = model.images[options.num_frames / 2].id;
  std::vector<char> is_removed(model.track_elements.size(), 0);
  for (const Point3D& point : model.points3D) {
    int num_before = 0, num_after = 0;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      num_before += model.track_elements[e].image_id < hinge;
      num_after += model.track_elements[e].image_id > hinge;
    }
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const ImageId id = model.track_elements[e].image_id;
      is_removed[e] = num_before > num_after ? id > hinge : id < hinge;
    }
  }
  return RemoveObservations(model, is_removed).model;
}

TEST(FilterOutliers, SaysThatNoTrackHoldsTheScaleAcrossAHinge) {
  for (const int num_frames : {3, 5, 7, 25}) {
    SceneOptions options = SceneInParts(SceneLayout::kStreet);
    options.num_frames = num_frames;
    options.track_length = std::min(options.track_length, 1.0 * num_frames);
    OutlierFilterOptions filter;
    filter.find_conflicts = false;
    const auto parts_not_held = [&](const Model& model) {
      int count = 0;
      for (const WeakPart& part :
           FilterOutliers(Wiped(model), filter, {}).summary.weak_parts) {
        count += !part.is_held && !part.is_frame;
      }
      return count;
    };
    EXPECT_EQ(parts_not_held(SynthesizeScene(options).model), 0) << num_frames;
    EXPECT_EQ(parts_not_held(Hinged(options)), 1) << num_frames;
  }
}

TEST(FindSoftPart, IsTheSmallerSideOfAHinge) {
  SceneOptions options = SceneInParts(SceneLayout::kStreet);
  options.num_frames = 8;
  const BuiltProblem whole = BuildProblem(SynthesizeScene(options).model, {});
  const auto soft_part = [](const BuiltProblem& built) {
    const std::vector<char> kept(built.problem.observations.size(), 1);
    return FindSoftPart(built.problem, built.start, kept, 8, {}).value();
  };
  EXPECT_LT(soft_part(whole).scale_factor, 1.05);
  const WeakLink link = soft_part(BuildProblem(Hinged(options), {}));
  EXPECT_EQ(link.frames, (std::vector<int32_t>{5, 6, 7}));
  EXPECT_EQ(link.scale_factor, kInfinity);
  EXPECT_FALSE(link.IsHeld());
}

TEST(FilterOutliers, TakesOtherComponentsForPartsThatNothingHolds) {
  const Model model = WeaklyTied(
      SynthesizeScene(SceneInParts(kTwoParts.layout)).model,
      [](int n) { return n / 14; }, [](int, int) { return false; },
      /*num_tracks=*/0, /*num_wrong=*/0);
  OutlierFilterOptions options;
  options.find_conflicts = false;
  const OutlierFilterResult result = FilterOutliers(Wiped(model), options, {});
  ASSERT_EQ(result.summary.weak_parts.size(), 1u);
  const WeakPart& part = result.summary.weak_parts[0];
  EXPECT_EQ(part.image_names.size(), 10u);
  EXPECT_EQ(part.num_tracks, 0);
  EXPECT_EQ(part.scale_factor, kInfinity);
  EXPECT_FALSE(part.is_held);
}

SceneOptions Street(int num_frames) {
  SceneOptions options = SceneOf(num_frames, 60 * num_frames, 5, 0.5);
  options.layout = SceneLayout::kStreet;
  options.camera_model_id = 1;
  return options;
}

// Baselines of pairs tell no distances, unless they close a figure.
TEST(FilterOutliers, NamesPartsOfChainsAndStarsOfPairsUntilOneScaleIsLeft) {
  OutlierFilterOptions options;
  options.find_conflicts = false;
  const Model scene = SynthesizeScene(Street(9)).model;
  const auto is_arm = [](int a, int b) { return a == 4 || b == 4; };
  for (const Model& pairs : {ChainOfPairs(scene), OfPairs(scene, is_arm)}) {
    const OutlierFilterSummary summary =
        FilterOutliers(Wiped(pairs), options, {}).summary;
    std::set<std::string> named;
    for (const WeakPart& part : summary.weak_parts) {
      EXPECT_FALSE(part.is_held);
      EXPECT_GT(part.num_tracks, 0);
      EXPECT_EQ(part.num_of_three, 0);
      EXPECT_EQ(part.scale_factor, kInfinity);
      named.insert(part.image_names.begin(), part.image_names.end());
    }
    std::set<ImageId> connected;
    for (const TrackElement& element : pairs.track_elements) {
      connected.insert(element.image_id);
    }
    // Images of which too few points tell depths are left, too: one of the
    // star.
    EXPECT_GE(named.size(), connected.size() - 3);
  }
}

// The turn that is found where this share of the baselines is left and the
// rotations of every other image are then turned by so much.
std::optional<double> TurnAtOneCentre(const Model& truth, double share,
                                      double degrees) {
  Model model = SeenFrom(truth, NearTheFirst(truth, share), 0.5);
  TurnPart([](int n) { return n % 2 == 1; }, degrees, &model);
  OutlierFilterOptions options;
  options.find_conflicts = false;
  return FilterOutliers(Wiped(model), options, {}).summary.one_centre_turn_deg;
}

TEST(FindTurnAtOneCentre, TellsPanoramasFromShortBaselines) {
  const Model truth = SynthesizeScene(Street(8)).ground_truth;
  EXPECT_EQ(TurnAtOneCentre(truth, 0, 0), 0);
  EXPECT_EQ(TurnAtOneCentre(truth, 1, 0), std::nullopt);
  EXPECT_EQ(TurnAtOneCentre(truth, 0.05, 0), std::nullopt);
}

TEST(FindTurnAtOneCentre, AllowsForRotationsThatAreOff) {
  const Model truth = SynthesizeScene(Street(8)).ground_truth;
  const std::optional<double> turn = TurnAtOneCentre(truth, 0, 0.2);
  ASSERT_TRUE(turn);
  EXPECT_GT(*turn, 0.05);
  EXPECT_LT(*turn, 0.3);
}

// Far from flat ground a shift is nearly a turn, but rotations are not off by
// so much.
TEST(FindTurnAtOneCentre, TakesNoLargeTurnForAnError) {
  Model truth = SynthesizeScene(Street(8)).ground_truth;
  for (Point3D& point : truth.points3D) point.xyz[2] += 30;
  const auto unturned = [](int, const RigidTransform& own) {
    return RigidTransform{Eigen::Matrix3d::Identity(), own.translation};
  };
  OutlierFilterOptions options;
  options.find_conflicts = false;
  const OutlierFilterResult result =
      FilterOutliers(Wiped(SeenFrom(truth, unturned, 0.5)), options, {});
  EXPECT_EQ(result.summary.one_centre_turn_deg, std::nullopt);
}

// A wrong observation may fit a point that is near enough.
TEST(FindTurnAtOneCentre, IsNotMisledByWrongObservations) {
  SceneOptions scene = Street(12);
  scene.num_points = 200;
  for (const uint64_t seed : {0u, 1u, 2u}) {
    scene.random_seed = seed;
    const Model truth = SynthesizeScene(scene).ground_truth;
    Model model = Wiped(SeenFrom(truth, NearTheFirst(truth, 0), 0.5));
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> share(0, 1);
    for (Image& image : model.images) {
      for (Point2D& pixel : image.points2D) {
        if (share(random) > 0.3) continue;
        pixel.x = 1024 * share(random);
        pixel.y = 768 * share(random);
      }
    }
    OutlierFilterOptions options;
    options.find_conflicts = false;
    EXPECT_TRUE(FilterOutliers(model, options, {}).summary.one_centre_turn_deg)
        << seed;
  }
}

TEST(FindTurnAtOneCentre, CannotBeToldWithoutObservations) {
  EXPECT_EQ(FindTurnAtOneCentre({}, {}, {}), std::nullopt);
}

TEST(WeakLink, IsNotHeldByTracksThatMayAgreeByChance) {
  WeakLink link;
  link.usual_share = 0.1;
  link.num_telling = 18;
  link.num_agreeing = 5;
  EXPECT_FALSE(link.IsHeld());
  link.num_agreeing = 6;
  EXPECT_TRUE(link.IsHeld());
  link.turn_deg = 10;
  EXPECT_FALSE(link.IsHeld());
}

TEST(FilterOutliers, NamesTheFramesThatKeepFewOfTheirObservations) {
  for (const std::set<int>& turned : {std::set<int>{}, {4}, {2, 11, 19}}) {
    Model model =
        Wiped(SynthesizeScene(SceneInParts(SceneLayout::kOrbit)).model);
    TurnPart([&](int n) { return turned.count(n) > 0; }, 40, &model);
    OutlierFilterOptions options;
    options.find_conflicts = false;
    const OutlierFilterResult result = FilterOutliers(model, options, {});
    std::set<int> found;
    for (const WeakPart& part : result.summary.weak_parts) {
      EXPECT_TRUE(part.is_frame);
      EXPECT_FALSE(part.is_held);
      EXPECT_LT(part.num_agreeing, part.num_tracks / 2);
      ASSERT_EQ(part.image_names.size(), 1u);
      for (int n = 0; n < 24; ++n) {
        if (model.images[n].name == part.image_names[0]) found.insert(n);
      }
    }
    EXPECT_EQ(found, turned);
  }
}

TEST(FilterOutliers, SaysByWhichTurnThePartsTracksWouldAgree) {
  for (const double degrees : {0.0, 20.0}) {
    const SyntheticScene scene =
        SynthesizeScene(SceneInParts(kTwoParts.layout));
    Model model = WeaklyTied(Wiped(scene.model), kTwoParts.part_of,
                             kTwoParts.are_tied, 30, 5);
    TurnPart([](int n) { return n >= 12; }, degrees, &model);
    OutlierFilterOptions options;
    options.max_error = 3;
    options.find_conflicts = false;
    const OutlierFilterResult result = FilterOutliers(model, options, {});
    ASSERT_EQ(result.summary.weak_parts.size(), 1u);
    const WeakPart& part = result.summary.weak_parts[0];
    EXPECT_EQ(part.is_held, degrees == 0);
    EXPECT_NEAR(part.turn_deg, degrees, 1);
    EXPECT_GE(part.num_agreeing_turned, degrees > 0 ? 20 : 0);
  }
}

// A quarter of tracks of three is wrong.
TEST(FindRobustStart, FindsThePositionsOfShortTracks) {
  for (const uint64_t seed : {0u, 1u, 2u}) {
    const SyntheticScene scene = ShortTracks(0.25, seed);
    EXPECT_LT(
        CentreError(scene.ground_truth, AtRobustStart(Wiped(scene.model))),
        0.02)
        << seed;
  }
}

// What the robust least squares has lost is placed anew.
TEST(FilterOutliers, FromNothingLosesFewRightObservations) {
  const SyntheticScene scene = ShortTracks(0.25, 0);
  OutlierFilterOptions options;
  options.find_conflicts = false;
  const OutlierFilterResult result =
      FilterOutliers(Wiped(scene.model), options, {});
  std::set<std::pair<ImageId, uint64_t>> wrong;
  for (const int64_t e : scene.outliers) {
    const TrackElement& element = scene.model.track_elements[e];
    wrong.insert({element.image_id, element.point2D_idx});
  }
  int64_t num_right = 0;  // that were removed
  for (const RemovedObservation& o : result.summary.removed) {
    num_right += wrong.count({o.image_id, o.point2D_idx}) == 0;
  }
  const auto num_of_right = static_cast<double>(
      scene.model.track_elements.size() - scene.outliers.size());
  EXPECT_LT(static_cast<double>(num_right), 0.06 * num_of_right);
}

TEST(FilterOutliers, PlacesAModelWithoutPositions) {
  const SyntheticScene scene = SynthesizeScene(Scene(0.05, 0));
  OutlierFilterOptions options;
  options.max_error = 3;
  const OutlierFilterResult result =
      FilterOutliers(Wiped(scene.model), options, {});
  const OutlierFilterSummary& summary = result.summary;
  EXPECT_TRUE(summary.is_within);
  EXPECT_EQ(summary.init, SolveInit::kFeasible);
  EXPECT_LT(CentreError(scene.ground_truth, result.model), 0.005);
  EXPECT_LE(summary.removed.size(), scene.outliers.size());
  EXPECT_LE(summary.num_proved, static_cast<int64_t>(summary.removed.size()));
  EXPECT_GT(summary.num_proved, 0);
}

TEST(FilterOutliers, SparesWhatFitsTheModelsOwnPositionsAndNothingElse) {
  OutlierFilterOptions options;
  options.find_conflicts = false;
  options.spared = OutlierFilterOptions::Spared::kWhatFitsItsPositions;
  options.solve.init = SolveInit::kFeasible;
  for (const double ratio : {0.0, 0.1}) {
    const SyntheticScene scene = SynthesizeScene(Scene(ratio, 0));
    const OutlierFilterResult result =
        FilterOutliers(scene.ground_truth, options, {});
    EXPECT_EQ(result.summary.is_spared, ratio == 0) << ratio;
  }
}

// Where no positions are known the largest error says nothing by itself: what
// noise explains goes to its least squares, which is nearer to the truth.
TEST(SolveTolerantly, FromNothingLooksForTheLowestMaximumOnlyIfAsked) {
  const SyntheticScene scene = SynthesizeScene(Scene(0, 0.02));
  const Model model = Wiped(scene.model);
  TolerantSolveOptions options;
  options.solve.init = SolveInit::kFeasible;
  const TolerantSolveResult result = SolveTolerantly(model, options, {});
  EXPECT_EQ(result.summary.termination, SolveTermination::kWithinBound);
  ASSERT_TRUE(result.outliers);
  EXPECT_TRUE(result.outliers->removed.empty());
  EXPECT_TRUE(result.outliers->is_within);

  options.solve.describe_certificate = true;
  const TolerantSolveResult proved = SolveTolerantly(model, options, {});
  EXPECT_EQ(proved.summary.termination, SolveTermination::kGapReached);
  EXPECT_FALSE(proved.outliers);
  EXPECT_LT(proved.summary.cost_final, result.summary.cost_final);
  EXPECT_LT(CentreError(scene.ground_truth, result.model),
            CentreError(scene.ground_truth, proved.model));

  const SolveModelResult alone = SolveModel(model, options.solve, {});
  EXPECT_NEAR(alone.summary.LowestCost(), proved.summary.LowestCost(),
              2e-4 * alone.summary.LowestCost());
  EXPECT_LT(proved.summary.iterations.size(), alone.summary.iterations.size());
}

TEST(SolveModel, LooksForAStartWhereTheOneFoundIsTooFarOff) {
  const Model model = Wiped(SynthesizeScene(Scene(0, 0)).model);
  SolveModelOptions options;
  options.init = SolveInit::kFeasible;
  const SolveModelResult right = SolveModel(model, options, {});
  BuildProblemOptions build;
  build.ignore_translations = true;
  options.found_start = BuildProblem(model, build).start;
  const SolveModelResult result = SolveModel(model, options, {});
  EXPECT_EQ(result.summary.cost_final, right.summary.cost_final);
}

TEST(FilterOutliers, PositionsMadeWithOtherRotationsSpareNothing) {
  const SyntheticScene scene = SynthesizeScene(Scene(0.1, 0));
  OutlierFilterOptions options;
  options.find_conflicts = false;
  options.spared = OutlierFilterOptions::Spared::kWhatFitsItsPositions;
  options.solve.init = SolveInit::kFeasible;
  options.solve.init_max_error = INFINITY;  // no error counts as gross
  for (const bool are_others : {false, true}) {
    options.has_other_rotations = are_others;
    const OutlierFilterResult result =
        FilterOutliers(scene.ground_truth, options, {});
    EXPECT_EQ(result.summary.is_spared, !are_others);
  }
}

TEST(FilterOutliers, ChoosesABoundWhereNoneIsGiven) {
  const SyntheticScene scene = SynthesizeScene(Scene(0.05, 0));
  OutlierFilterOptions options;
  options.find_conflicts = false;
  const OutlierFilterResult result =
      FilterOutliers(Wiped(scene.model), options, {});
  EXPECT_TRUE(result.summary.is_within);
  EXPECT_GT(result.summary.max_error, 2);
  EXPECT_LT(result.summary.max_error, 20);
  EXPECT_FALSE(result.summary.conflicts);
}

}  // namespace
}  // namespace krot::internal
