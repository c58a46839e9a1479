#include "krot/model/model_checks.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/model/model_io.h"
#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

using ::testing::HasSubstr;
using Observation = std::tuple<ImageId, uint32_t, Point3DId>;

std::multiset<Observation> OfTracks(const Model& model) {
  std::multiset<Observation> observations;
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model.track_elements[e];
      observations.emplace(element.image_id, element.point2D_idx, point.id);
    }
  }
  return observations;
}

// Of 3D points that exist.
std::multiset<Observation> OfImages(const Model& model) {
  std::set<Point3DId> ids;
  for (const Point3D& point : model.points3D) ids.insert(point.id);
  std::multiset<Observation> observations;
  for (const Image& image : model.images) {
    for (uint32_t i = 0; i < image.points2D.size(); ++i) {
      const Point3DId id = image.points2D[i].point3D_id;
      if (ids.count(id) > 0) observations.emplace(image.id, i, id);
    }
  }
  return observations;
}

// The tiny model has track elements {9, 0}, {4000000000, 2} of point
// 5000000000 and {9, 1}, {4000000000, 0}, {4000000000, 3} of point 12.
Model WithElement(int e, ImageId image_id, uint32_t point2D_idx) {
  Model model = TinyModel();
  model.track_elements[e] = {image_id, point2D_idx};
  return model;
}

// Following the images leaves their observations and no contradiction.
void ExpectImagesCanBeFollowed(const Model& model) {
  Model followed = model;
  Follow(Reading::kImages, &followed);
  EXPECT_NO_THROW(ValidateModel(followed));
  EXPECT_FALSE(FindContradictions(followed).Any());
  EXPECT_EQ(OfTracks(followed), OfImages(model));
  EXPECT_EQ(OfImages(followed), OfImages(model));
}

void ExpectContradictions(const Model& model, int num_track_elements,
                          int num_points2D, const std::string& first) {
  const Contradictions found = FindContradictions(model);
  EXPECT_EQ(found.num_track_elements, num_track_elements);
  EXPECT_EQ(found.num_points2D, num_points2D);
  EXPECT_EQ(found.first, first);
  EXPECT_EQ(found.Any(), num_track_elements + num_points2D > 0);
  EXPECT_NO_THROW(ValidateModel(model));
  ExpectImagesCanBeFollowed(model);
}

TEST(Contradictions, AreNotFoundInAModelThatAgreesWithItself) {
  for (const Model& model : {TinyModel(), TinyRigModel(), Model()}) {
    ExpectContradictions(model, 0, 0, "");
    Model followed = model;
    Follow(Reading::kImages, &followed);
    EXPECT_THAT(followed, IsModel(model));
  }
}

TEST(Contradictions, AreTrackElementsWhose2DPointNamesAnother3DPoint) {
  const Model model = WithElement(2, 9, 0);
  ExpectContradictions(model, 1, 1,
                       "3D point 12: found 2D point 0 of image 9 (\"c.jpg\") "
                       "in its track, but that 2D point names 3D point "
                       "5000000000");
}

TEST(Contradictions, AreTrackElementsWhose2DPointNamesNo3DPoint) {
  const Model model = WithElement(3, 4000000000, 1);
  ExpectContradictions(model, 1, 1,
                       "3D point 12: found 2D point 1 of image 4000000000 "
                       "(\"left/a b.jpg\") in its track, but that 2D point "
                       "names no 3D point");
}

TEST(Contradictions, AreTrackElementsThatTheTrackHoldsAlready) {
  const Model model = WithElement(4, 4000000000, 0);
  ExpectContradictions(model, 1, 1,
                       "3D point 12: found 2D point 0 of image 4000000000 "
                       "(\"left/a b.jpg\") twice in its track, expected once");
}

TEST(Contradictions, Are2DPointsThatTheTrackOfTheir3DPointDoesNotName) {
  Model model = TinyModel();
  model.images[0].points2D[1].point3D_id = 1;
  ExpectContradictions(model, 0, 1,
                       "image 4000000000 (\"left/a b.jpg\"): found 3D point 1 "
                       "at 2D point 1, but the track of that 3D point does not "
                       "name this 2D point");
}

TEST(Contradictions, Are2DPointsWhose3DPointDoesNotExist) {
  Model model = TinyModel();
  model.images[0].points2D[1].point3D_id = 99;
  ExpectContradictions(model, 0, 1,
                       "image 4000000000 (\"left/a b.jpg\"): found 3D point id "
                       "99 at 2D point 1, expected one that exists in "
                       "points3D");
}

TEST(Contradictions, WithImagesAnd2DPointsThatDoNotExistGoWithTheImages) {
  for (const Model& model : {WithElement(0, 8, 0), WithElement(0, 9, 2)}) {
    EXPECT_THAT(ModelErrorOf([&] { ValidateModel(model); }),
                HasSubstr("; --Model.on_contradiction follow_images reads the "
                          "rest"));
    const Contradictions found = FindContradictions(model);
    EXPECT_EQ(found.num_track_elements, 1);
    EXPECT_EQ(found.num_points2D, 1);
    ExpectImagesCanBeFollowed(model);
  }
}

TEST(Follow, TheImagesKeepsTheOrderOfATrackAndAppendsWhatItLacked) {
  Model model = WithElement(3, 9, 0);  // of point 12, between two that agree
  Follow(Reading::kImages, &model);
  ASSERT_EQ(model.track_elements.size(), 5u);
  EXPECT_EQ(model.track_elements[2].image_id, 9u);
  EXPECT_EQ(model.track_elements[3].point2D_idx, 3u);
  EXPECT_EQ(model.track_elements[4].point2D_idx, 0u);
}

// POINT2D_IDX in the one does not index the other; MANIFEST's count, and a
// dozen lines of Python's, of the others.
TEST(Contradictions, OfRealModelsAreCounted) {
  if (!RealModels()) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  const std::tuple<const char*, int, int> kModels[] = {
      {"edge_bad_point2d_idx_txt", 5160, 5160},
      {"edge_tracks_of_one_txt", 945, 945},
      {"glomap100", 16953, 0},
  };
  for (const auto& [name, num_track_elements, num_points2D] : kModels) {
    const std::filesystem::path path = *RealModels() / name;
    const Model model = ReadModel(path, DetectModelFormat(path));
    EXPECT_NO_THROW(ValidateModel(model)) << name;
    const Contradictions found = FindContradictions(model);
    EXPECT_EQ(found.num_track_elements, num_track_elements) << name;
    EXPECT_EQ(found.num_points2D, num_points2D) << name;
    ExpectImagesCanBeFollowed(model);
  }
}

// {9, 0} in the tracks of both points, named by the first: theirs.
TEST(Follow, TheTracksLeavesA2DPointOfTwoTracksToTheOneThatItNames) {
  Model model = WithElement(2, 9, 0);
  Follow(Reading::kTracks, &model);
  EXPECT_NO_THROW(ValidateModel(model));
  EXPECT_FALSE(FindContradictions(model).Any());
  Model expected = TinyModel();
  std::multiset<Observation> observations = OfTracks(expected);
  observations.erase({9, 1, 12});  // which no track names any more
  EXPECT_EQ(OfTracks(model), observations);
}

TEST(Follow, TheTracksLeavesA2DPointOfTwoTracksToTheFirstIfItNamesNeither) {
  Model model = WithElement(2, 9, 0);
  model.images[2].points2D[0].point3D_id = 1;
  Follow(Reading::kTracks, &model);
  EXPECT_FALSE(FindContradictions(model).Any());
  EXPECT_EQ(OfTracks(model).count({9, 0, 5000000000}), 1u);
  EXPECT_EQ(OfTracks(model).count({9, 0, 12}), 0u);
}

TEST(Follow, BothTakesTheTracksWhere2DPointsNameNothing) {
  Model model = TinyModel();
  model.images[2].points2D[1].point3D_id = kInvalidPoint3DId;  // of point 12
  model.images[0].points2D[3].point3D_id = 1;                  // likewise
  Follow(Reading::kBoth, &model);
  EXPECT_NO_THROW(ValidateModel(model));
  EXPECT_FALSE(FindContradictions(model).Any());
  EXPECT_EQ(OfTracks(model).count({9, 1, 12}), 1u);
  EXPECT_EQ(OfTracks(model).count({4000000000, 3, 1}), 1u);
  EXPECT_EQ(OfTracks(model).count({4000000000, 3, 12}), 0u);
  EXPECT_EQ(OfTracks(model).size(), 5u);
}

}  // namespace
}  // namespace krot::internal
