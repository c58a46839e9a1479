#include "krot/outliers/match_tracks.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::IsEmpty;
using Track = std::vector<std::pair<ImageId, uint32_t>>;

Model MatchedScene(double pixel_noise = 0) {
  return SynthesizeScene(SceneOf(10, 800, 5, pixel_noise, 4)).ground_truth;
}

Model PosesOf(Model model) {
  model.points3D.clear();
  model.track_elements.clear();
  for (Image& image : model.images) image.points2D.clear();
  return model;
}

// Tracks, each in order, of `least` and more images.
std::set<Track> TracksOf(const Model& model, size_t least = 2) {
  std::set<Track> tracks;
  for (const Point3D& point : model.points3D) {
    Track track;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      track.emplace_back(model.track_elements[e].image_id,
                         model.track_elements[e].point2D_idx);
    }
    std::sort(track.begin(), track.end());
    if (track.size() >= least) tracks.insert(track);
  }
  return tracks;
}

MatchTracksResult Triangulate(const Model& poses, const Database& database,
                              const MatchTracksOptions& options = {}) {
  MatchTracksResult result = TriangulateMatches(poses, database, options, {});
  ValidateModel(result.model);
  for (const double error : PixelErrors(result.model)) {
    EXPECT_LE(error, options.max_error_px);
  }
  return result;
}

TEST(TriangulateMatches, MakesTheTracksThatMatchesWereMadeFrom) {
  const Model truth = MatchedScene();
  MatchTracksOptions options;
  options.min_angle_deg = 0;
  const MatchTracksResult made =
      Triangulate(PosesOf(truth), DatabaseOf(truth), options);
  EXPECT_EQ(TracksOf(made.model, 3), TracksOf(truth, 3));
  EXPECT_EQ(made.summary.num_disagreeing, 0);
  EXPECT_EQ(made.summary.num_in_conflict, 0);
  std::map<Track, Eigen::Vector3d> places;
  for (const Point3D& point : truth.points3D) {
    const TrackElement& first = truth.track_elements[point.track_begin];
    places[{{first.image_id, first.point2D_idx}}] = point.xyz;
  }
  for (const Point3D& point : made.model.points3D) {
    Track first;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = made.model.track_elements[e];
      const auto found = places.find({{element.image_id, element.point2D_idx}});
      if (found == places.end()) continue;
      EXPECT_LT((found->second - point.xyz).norm(), 1e-6);
    }
  }
}

TEST(PlaceMatches, FindsPositionsAndPointsFromRotationsAndMatchesAlone) {
  const Model truth = MatchedScene(0.3);
  Database database = DatabaseOf(truth);
  std::mt19937 random(3);
  for (VerifiedPair& pair : database.pairs) {
    const size_t num_matches = pair.matches.size();
    for (size_t n = 0; n < num_matches / 4; ++n) {
      pair.matches.push_back({pair.matches[random() % num_matches][0],
                              pair.matches[random() % num_matches][1]});
    }
  }
  Model poses = PosesOf(truth);
  for (Frame& frame : poses.frames) {
    frame.rig_from_world.translation.setConstant(NAN);
  }
  const PlacedMatches placed = PlaceMatches(poses, database, {}, {});
  ValidateModel(placed.model);
  EXPECT_EQ(placed.num_unplaced, 0);
  EXPECT_GT(10 * TracksOf(placed.model, 3).size(),
            9 * TracksOf(truth, 3).size());
  const auto centers = [](const Model& model) {
    std::vector<Eigen::Vector3d> all;
    for (const ImageGeometry& image : ImageGeometries(model)) {
      all.push_back(Center(image.cam_from_world));
    }
    return all;
  };
  const auto found = centers(placed.model), expected = centers(truth);
  const double scale =
      (found[1] - found[0]).norm() / (expected[1] - expected[0]).norm();
  for (size_t i = 1; i < found.size(); ++i) {
    const Eigen::Vector3d a = (found[i] - found[0]) / scale;
    EXPECT_LT((a - (expected[i] - expected[0])).norm(), 0.02 * a.norm());
  }
}

TEST(PlaceMatches, TakesNothingButPlaceAndScaleFromTheModelsPositions) {
  const Model truth = MatchedScene(0.3);
  const Database database = DatabaseOf(truth);
  Model poses = PosesOf(truth);
  const PlacedMatches placed = PlaceMatches(poses, database, {}, {});
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.3);
  for (Frame& frame : poses.frames) {
    for (double& t : frame.rig_from_world.translation) t += noise(random);
  }
  const PlacedMatches other = PlaceMatches(poses, database, {}, {});
  EXPECT_EQ(TracksOf(placed.model), TracksOf(other.model));
}

TEST(PlaceMatches, CountsImagesThatNoMatchesHold) {
  const Model truth = MatchedScene();
  Database database = DatabaseOf(truth);
  for (VerifiedPair& pair : database.pairs) {
    if (pair.image1 == 3 || pair.image2 == 3) pair.matches.resize(1);
  }
  const PlacedMatches placed = PlaceMatches(truth, database, {}, {});
  EXPECT_EQ(placed.num_unplaced, 1);
  EXPECT_EQ(placed.model.frames[3].rig_from_world.translation,
            truth.frames[3].rig_from_world.translation);
}

// Joins tracks by matches that their epipolar lines agree with.
TEST(TriangulateMatches, DividesTracksThatWrongMatchesJoinByTheirResiduals) {
  const Model truth = MatchedScene(0.3);
  Database database = DatabaseOf(truth);
  const MatchTracksResult sound = Triangulate(PosesOf(truth), database);
  std::mt19937 random(2);
  int num_added = 0;
  for (VerifiedPair& pair : database.pairs) {
    const size_t num_matches = pair.matches.size();
    if (num_matches < 15) continue;
    for (size_t n = 0; n < num_matches / 4; ++n) {
      pair.matches.push_back({pair.matches[random() % num_matches][0],
                              pair.matches[random() % num_matches][1]});
      ++num_added;
    }
  }
  const MatchTracksResult made = Triangulate(PosesOf(truth), database);
  EXPECT_GT(made.summary.num_disagreeing, num_added / 2);
  EXPECT_GT(made.summary.num_image_twice, 5);
  // Of three and more images, since a wrong match also makes a track of two
  // from keypoints that nothing checked before.
  const std::set<Track> before = TracksOf(sound.model, 3);
  const std::set<Track> after = TracksOf(made.model, 3);
  std::vector<Track> common;
  std::set_intersection(before.begin(), before.end(), after.begin(),
                        after.end(), std::back_inserter(common));
  EXPECT_GT(common.size(), 0.98 * static_cast<double>(before.size()));
  EXPECT_GT(common.size(), 0.98 * static_cast<double>(after.size()));
}

TEST(TriangulateMatches, TakesOfTwoKeypointsOfAnImageTheNearerOne) {
  Model truth = MatchedScene();
  // Each of the first image's 2D points has a twin that is 3 pixels off, which
  // has the same matches.
  Image& image = truth.images[0];
  const auto num_points = static_cast<uint32_t>(image.points2D.size());
  for (uint32_t k = 0; k < num_points; ++k) {
    const Point2D point = image.points2D[k];
    image.points2D.push_back({point.x + 3, point.y, kInvalidPoint3DId});
  }
  Database database = DatabaseOf(truth);
  for (VerifiedPair& pair : database.pairs) {
    if (pair.image1 != 0) continue;
    const auto matches = pair.matches;
    for (const auto& [k1, k2] : matches) {
      pair.matches.push_back({k1 + num_points, k2});
    }
  }
  MatchTracksOptions options;
  options.min_angle_deg = 0;
  const Model made = Triangulate(PosesOf(truth), database, options).model;
  int64_t num_twins = 0, num_first = 0;
  for (const Track& track : TracksOf(made, 3)) {
    for (size_t n = 1; n < track.size(); ++n) {
      EXPECT_NE(track[n - 1].first, track[n].first);
    }
    for (const auto& [id, k] : track) {
      if (id != image.id) continue;
      ++(k < num_points ? num_first : num_twins);
    }
  }
  EXPECT_GT(num_first, 100);
  EXPECT_EQ(num_twins, 0);
}

TEST(TriangulateMatches, DependsOnNoOrderAndNoNumberOfThreads) {
  const Model truth = MatchedScene(1);
  Database database = DatabaseOf(truth);
  const Model a = TriangulateMatches(PosesOf(truth), database, {}, {1}).model;
  std::mt19937 random(2);
  std::shuffle(database.pairs.begin(), database.pairs.end(), random);
  for (VerifiedPair& pair : database.pairs) {
    std::shuffle(pair.matches.begin(), pair.matches.end(), random);
  }
  const Model b = TriangulateMatches(PosesOf(truth), database, {}, {3}).model;
  EXPECT_THAT(b, IsModel(a));
}

TEST(TriangulateMatches, LeavesOutWhatNothingChecksAndNarrowRays) {
  const Model truth = MatchedScene();
  MatchTracksOptions options;
  options.min_angle_deg = 60;
  const MatchTracksResult made =
      Triangulate(PosesOf(truth), DatabaseOf(truth), options);
  EXPECT_GT(made.summary.num_two_views, 0);
  EXPECT_GT(made.summary.num_narrow, 0);
  const auto indices = ImageIndices(made.model);
  const auto geometries = ImageGeometries(made.model);
  for (const Point3D& point : made.model.points3D) {
    EXPECT_GT(point.track_end - point.track_begin, 2u);
    double smallest = 1;
    for (uint64_t a = point.track_begin; a < point.track_end; ++a) {
      for (uint64_t b = point.track_begin; b < a; ++b) {
        const auto ray = [&](uint64_t e) {
          const int32_t i = indices.at(made.model.track_elements[e].image_id);
          return (point.xyz - Center(geometries[i].cam_from_world))
              .normalized();
        };
        smallest = std::min(smallest, ray(a).dot(ray(b)));
      }
    }
    EXPECT_LE(smallest, 0.5 + 1e-12);
  }
}

TEST(TriangulateMatches, DoesNotUsePairsThatContradictThePoses) {
  const Model truth = MatchedScene();
  Model poses = PosesOf(truth);
  Pose& pose = poses.frames[ImageGeometries(poses)[3].frame].rig_from_world;
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.2, Eigen::Vector3d(1, 2, 2) / 3).matrix();
  pose = ToPose({turn * pose.Rotation(), turn * pose.translation});
  const MatchTracksResult made = Triangulate(poses, DatabaseOf(truth));
  EXPECT_GT(made.summary.num_contradictory_pairs, 0);
  EXPECT_GT(made.model.points3D.size(), 300u);
  for (const TrackElement& element : made.model.track_elements) {
    EXPECT_NE(element.image_id, poses.images[3].id);
  }
}

TEST(TriangulateMatches, KeepsTheModelsTracksIfAsked) {
  const Model truth = MatchedScene();
  Database database = DatabaseOf(truth);
  database.pairs.clear();
  MatchTracksOptions options;
  options.min_angle_deg = 0;
  EXPECT_THAT(Triangulate(truth, database, options).model.points3D, IsEmpty());
  options.keeps_tracks = true;
  EXPECT_EQ(TracksOf(Triangulate(truth, database, options).model, 3),
            TracksOf(truth, 3));
  database.keypoints[0].pop_back();
  EXPECT_THROW(TriangulateMatches(truth, database, options, {}), ModelError);
  options.max_error_px = 0;
  EXPECT_THROW(TriangulateMatches(truth, database, options, {}),
               std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
