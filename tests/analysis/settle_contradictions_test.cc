#include "krot/analysis/model_input.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

Model ContradictoryScene() {
  return SynthesizeScene(SceneOf(6, 60, 6, 0.5)).ground_truth;
}

Image& ImageOf(Model* model, ImageId id) {
  return *std::find_if(model->images.begin(), model->images.end(),
                       [id](const Image& image) { return image.id == id; });
}

Point3DId& NameOf(Model* model, const TrackElement& element) {
  return ImageOf(model, element.image_id)
      .points2D[element.point2D_idx]
      .point3D_id;
}

// Every 2D point names what its neighbour should: `num_wrong` of each image.
Model WithNamesOfNeighbours(Model model, size_t num_wrong) {
  for (Image& image : model.images) {
    const size_t count = std::min(num_wrong, image.points2D.size());
    const Point3DId first = image.points2D.front().point3D_id;
    for (size_t i = 0; i + 1 < count; ++i) {
      image.points2D[i].point3D_id = image.points2D[i + 1].point3D_id;
    }
    image.points2D[count - 1].point3D_id = first;
  }
  return model;
}

// Every element of a track names the 2D point that is next in its image.
Model WithTracksOfNeighbours(Model model) {
  for (TrackElement& element : model.track_elements) {
    const size_t count = ImageOf(&model, element.image_id).points2D.size();
    element.point2D_idx =
        static_cast<uint32_t>((element.point2D_idx + 1) % count);
  }
  return model;
}

double Largest(const Model& model) { return Summarize(PixelErrors(model)).max; }

// What `auto` follows; the model agrees with itself afterwards.
std::string FollowedIn(Model* model) {
  const Contradictions found = SettleContradictions("auto", model);
  if (found.followed != "neither") {
    EXPECT_NO_THROW(ValidateModel(*model));
    EXPECT_FALSE(FindContradictions(*model).Any());
  }
  return found.followed;
}

TEST(SettleContradictions, LeavesAModelThatAgreesWithItselfAlone) {
  const Model scene = ContradictoryScene();
  for (const char* value :
       {"auto", "follow_tracks", "follow_images", "refuse"}) {
    Model model = scene;
    const Contradictions found = SettleContradictions(value, &model);
    EXPECT_EQ(found.followed, "");
    EXPECT_FALSE(found.of_tracks || found.of_images);
    EXPECT_THAT(model, IsModel(scene));
  }
}

TEST(SettleContradictions, RefusesAnotherValue) {
  Model model = ContradictoryScene();
  EXPECT_THROW(SettleContradictions("tracks", &model), std::invalid_argument);
}

TEST(SettleContradictions, FollowsTheImagesWhereTracksNameWrong2DPoints) {
  const Model scene = ContradictoryScene();
  Model model = WithTracksOfNeighbours(scene);
  EXPECT_EQ(FollowedIn(&model), "images");
  EXPECT_EQ(model.track_elements.size(), scene.track_elements.size());
  EXPECT_EQ(Largest(model), Largest(scene));
}

TEST(SettleContradictions, FollowsTheTracksWhere2DPointsNameWrong3DPoints) {
  const Model scene = ContradictoryScene();
  Model model = WithNamesOfNeighbours(scene, 1000);
  EXPECT_EQ(FollowedIn(&model), "tracks");
  EXPECT_THAT(model, IsModel(scene));
}

TEST(SettleContradictions, FollowsTheBetterSideWhereAThirdOfTheOtherIsWrong) {
  const Model scene = ContradictoryScene();
  const size_t num_wrong = scene.images[0].points2D.size() / 3;
  Model model = WithNamesOfNeighbours(scene, num_wrong);
  const Contradictions found = SettleContradictions("auto", &model);
  EXPECT_LT(found.of_images->median, 2);  // that says nothing
  EXPECT_EQ(found.followed, "tracks");
  EXPECT_THAT(model, IsModel(scene));
}

TEST(SettleContradictions, CountsElementsThatDoNotExistAsInfinitelyWrong) {
  const Model scene = ContradictoryScene();
  Model model = scene;
  for (TrackElement& element : model.track_elements) {
    element.point2D_idx += 100000;
  }
  const Contradictions found = SettleContradictions("auto", &model);
  EXPECT_EQ(found.followed, "images");
  EXPECT_TRUE(std::isnan(found.of_tracks->median));
  EXPECT_EQ(found.of_tracks->num_missing,
            static_cast<int64_t>(scene.track_elements.size()));
  EXPECT_EQ(Largest(model), Largest(scene));
}

// The errors that are told are those of what can be measured.
TEST(SettleContradictions, TellsErrorsWithoutWhatDoesNotExist) {
  const Model scene = ContradictoryScene();
  Model model = scene;
  int64_t num_missing = 0;
  for (size_t e = 0; e < model.track_elements.size(); ++e) {
    if (e % 3 == 0) continue;
    model.track_elements[e].image_id = 4000;
    ++num_missing;
  }
  const Contradictions found = SettleContradictions("auto", &model);
  EXPECT_EQ(found.followed, "images");
  EXPECT_EQ(found.of_tracks->num_missing, num_missing);
  EXPECT_LT(found.of_tracks->max, 10);
  EXPECT_EQ(found.of_images->num_missing, 0);
}

TEST(WorseImagesSide, IsThatOfAModelThatContradictsItselfAndFittedAlone) {
  const Model scene = ContradictoryScene();
  Model moved = scene;
  for (Point3D& point : moved.points3D) point.xyz *= 1.01;
  EXPECT_FALSE(WorseImagesSide(scene, moved));
  const Model contradictory = WithTracksOfNeighbours(scene);
  EXPECT_FALSE(WorseImagesSide(contradictory, contradictory));
  Model moved_too = contradictory;
  for (Point3D& point : moved_too.points3D) point.xyz *= 1.01;
  const auto worse = WorseImagesSide(contradictory, moved_too);
  ASSERT_TRUE(worse);
  EXPECT_EQ(worse->first, Largest(scene));
  EXPECT_EQ(worse->second, Largest(moved));
  // Names of neighbours never fitted: it does not matter how they come out.
  EXPECT_FALSE(WorseImagesSide(WithNamesOfNeighbours(scene, 1000),
                               WithNamesOfNeighbours(moved, 1000)));
}

TEST(SettleContradictions, LetsTracksSpeakFor2DPointsThatNameNothing) {
  const Model scene = ContradictoryScene();
  for (const size_t every : {1, 3}) {
    Model model = scene;
    for (size_t e = 0; e < model.track_elements.size(); e += every) {
      NameOf(&model, model.track_elements[e]) = kInvalidPoint3DId;
    }
    EXPECT_EQ(FollowedIn(&model), "both");
    EXPECT_THAT(model, IsModel(scene));
  }
}

TEST(SettleContradictions, LetsImagesSpeakForTracksThatAreEmpty) {
  const Model scene = ContradictoryScene();
  Model model = scene;
  model.track_elements.clear();
  for (Point3D& point : model.points3D) point.track_begin = point.track_end = 0;
  EXPECT_EQ(FollowedIn(&model), "both");
  EXPECT_EQ(model.track_elements.size(), scene.track_elements.size());
  EXPECT_EQ(Largest(model), Largest(scene));
}

// The last track also ends with a 2D point of the first.
Model WithA2DPointInTwoTracks(Model model) {
  model.track_elements.push_back(model.track_elements.front());
  ++model.points3D.back().track_end;
  return model;
}

TEST(SettleContradictions, LeavesA2DPointInTwoTracksToTheOneThatItNames) {
  const Model scene = ContradictoryScene();
  Model model = WithA2DPointInTwoTracks(scene);
  EXPECT_EQ(FollowedIn(&model), "both");
  EXPECT_THAT(model, IsModel(scene));
}

TEST(SettleContradictions, DropsWhatOnlyOneSideHasIfItIsTheWorst) {
  const Model scene = ContradictoryScene();
  Model model = WithA2DPointInTwoTracks(scene);
  NameOf(&model, model.track_elements.front()) = kInvalidPoint3DId;
  // Of the two tracks the first comes first, which is right here.
  Model right = model;
  EXPECT_EQ(FollowedIn(&right), "both");
  EXPECT_THAT(right, IsModel(scene));
  // In the other order the 2D point would go to the wrong one.
  model = scene;
  NameOf(&model, model.track_elements.back()) = kInvalidPoint3DId;
  model.track_elements.insert(
      model.track_elements.begin() +
          static_cast<std::ptrdiff_t>(model.points3D[0].track_end),
      model.track_elements.back());
  for (Point3D& point : model.points3D) {
    ++point.track_end;
    if (point.id != model.points3D[0].id) ++point.track_begin;
  }
  EXPECT_EQ(FollowedIn(&model), "images");
  EXPECT_LE(Largest(model), Largest(scene));
  EXPECT_EQ(model.track_elements.size(), scene.track_elements.size() - 1);
}

TEST(SettleContradictions, ChoosesNeitherWhereNeitherFits) {
  Model model =
      WithTracksOfNeighbours(WithNamesOfNeighbours(ContradictoryScene(), 1000));
  // Names are one off, tracks are, too, but in the other direction.
  const Model before = model;
  EXPECT_EQ(FollowedIn(&model), "neither");
  EXPECT_THAT(model, IsModel(before));
}

TEST(SettleContradictions, HasNothingToChooseWithoutTracks) {
  Model model =
      WithTracksOfNeighbours(WithNamesOfNeighbours(ContradictoryScene(), 1000));
  model.points3D.resize(1);
  model.points3D[0].track_end = 1;
  model.track_elements.resize(1);
  for (Image& image : model.images) {
    for (Point2D& point : image.points2D) point.point3D_id = kInvalidPoint3DId;
  }
  EXPECT_EQ(FollowedIn(&model), "both");
}

TEST(SettleContradictions, HasNothingToMeasureByWithoutPositions) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const double value : {0.0, nan}) {
    Model model = WithA2DPointInTwoTracks(ContradictoryScene());
    for (Frame& frame : model.frames) {
      frame.rig_from_world.translation.setConstant(value);
    }
    for (Image& image : model.images) {
      image.cam_from_world.translation.setConstant(value);
    }
    for (Point3D& point : model.points3D) point.xyz.setZero();
    const Contradictions found = SettleContradictions("auto", &model);
    EXPECT_FALSE(found.of_tracks || found.of_images);
    EXPECT_EQ(found.followed, "both");
  }
}

}  // namespace
}  // namespace krot::internal
