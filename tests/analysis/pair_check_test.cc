#include "krot/database.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/analysis/epipolar.h"
#include "krot/base/numbers.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

int64_t CostOf(const std::vector<bool>& is_wrong,
               const std::vector<int64_t>& costs,
               const std::vector<ContradictoryPair>& contradictions) {
  int64_t cost = 0;
  for (size_t i = 0; i < costs.size(); ++i) cost += is_wrong[i] ? costs[i] : 0;
  for (const ContradictoryPair& pair : contradictions) {
    if (!is_wrong[pair.image1] && !is_wrong[pair.image2]) {
      cost += pair.num_matches;
    }
  }
  return cost;
}

TEST(ExplainContradictions, IsAsCheapAsTheCheapestOfAllSets) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 300; ++trial) {
    const int n = 2 + trial % 9;
    std::vector<int64_t> costs(n);
    for (int64_t& cost : costs) cost = random() % 200;
    std::vector<ContradictoryPair> contradictions;
    for (int32_t a = 0; a < n; ++a) {
      for (int32_t b = a + 1; b < n; ++b) {
        if (random() % 3 != 0) continue;
        contradictions.push_back({a, b, static_cast<int64_t>(random() % 100)});
      }
    }
    int64_t cheapest = std::numeric_limits<int64_t>::max();
    for (int set = 0; set < (1 << n); ++set) {
      std::vector<bool> is_wrong(n);
      for (int i = 0; i < n; ++i) is_wrong[i] = (set >> i & 1) != 0;
      cheapest = std::min(cheapest, CostOf(is_wrong, costs, contradictions));
    }
    const Explanations found = ExplainContradictions(costs, contradictions);
    EXPECT_TRUE(found.is_proved);
    EXPECT_EQ(found.cheapest.cost, cheapest);
    std::vector<bool> is_wrong(n);
    for (const int32_t i : found.cheapest.images) is_wrong[i] = true;
    EXPECT_EQ(CostOf(is_wrong, costs, contradictions), cheapest);
    if (!found.runner_up) continue;
    EXPECT_GE(found.runner_up->cost, cheapest);
    EXPECT_NE(found.runner_up->images, found.cheapest.images);
  }
}

TEST(ExplainContradictions, BlamesTheImageThatAllOthersContradict) {
  const Explanations found = ExplainContradictions(
      {10, 500, 500, 500}, {{0, 1, 100}, {0, 2, 90}, {0, 3, 80}, {2, 3, 20}});
  EXPECT_THAT(found.cheapest.images, ElementsAre(0));
  EXPECT_EQ(found.cheapest.cost, 10 + 20);
  EXPECT_FALSE(found.runner_up);
}

// Whatever else is contradicted.
TEST(ExplainContradictions, TellsOfAnotherThatGivesUpAboutAsMuch) {
  const std::vector<int64_t> costs = {100, 500, 500, 5000, 5000};
  const ContradictoryPair elsewhere = {3, 4, 3000};
  const Explanations near =
      ExplainContradictions(costs, {{0, 1, 85}, {0, 2, 20}, elsewhere});
  EXPECT_THAT(near.cheapest.images, ElementsAre(0));
  ASSERT_TRUE(near.runner_up);
  EXPECT_THAT(near.runner_up->images, IsEmpty());
  const Explanations far =
      ExplainContradictions(costs, {{0, 1, 30}, {0, 2, 20}, elsewhere});
  EXPECT_THAT(far.cheapest.images, IsEmpty());
  EXPECT_FALSE(far.runner_up);
}

TEST(ExplainContradictions, ThatEndsEarlyIsAnExplanationAndSaysSo) {
  std::mt19937 random(6);
  std::vector<int64_t> costs(100);
  for (int64_t& cost : costs) cost = 400 + random() % 100;
  std::vector<ContradictoryPair> contradictions;
  for (int32_t a = 0; a < 100; ++a) {
    for (int32_t b = a + 1; b < 100; ++b) {
      if (random() % 8 != 0) continue;
      contradictions.push_back(
          {a, b, 50 + static_cast<int64_t>(random() % 50)});
    }
  }
  const Explanations found =
      ExplainContradictions(costs, contradictions, 1000000);
  EXPECT_FALSE(found.is_proved);
  std::vector<bool> is_wrong(100);
  for (const int32_t i : found.cheapest.images) is_wrong[i] = true;
  EXPECT_EQ(CostOf(is_wrong, costs, contradictions), found.cheapest.cost);
}

// Exact poses, noise of half a pixel, cameras with a lens.
Model Scene() {
  return SynthesizeScene(SceneOf(12, 1500, 6, 0.5, 3)).ground_truth;
}

// Turns an image about its centre by an angle in degrees, and moves it.
void Change(int image, double turn_deg, double shift, Model* model) {
  const ImageGeometry geometry = ImageGeometries(*model)[image];
  RigidTransform cam_from_world = geometry.cam_from_world;
  const Eigen::Vector3d axis = Eigen::Vector3d(0.3, 1, 0.2).normalized();
  const Eigen::Vector3d center =
      Center(cam_from_world) + shift * Eigen::Vector3d(0.6, 0, -0.8);
  cam_from_world.rotation =
      Eigen::AngleAxisd(turn_deg / kDegreesPerRadian, axis) *
      cam_from_world.rotation;
  cam_from_world.translation = -cam_from_world.rotation * center;
  model->frames[geometry.frame].rig_from_world =
      ToPose(Inverse(geometry.cam_from_rig) * cam_from_world);
}

std::vector<int32_t> WrongImages(const PairCheck& check) {
  std::vector<int32_t> wrong;
  for (size_t i = 0; i < check.images.size(); ++i) {
    if (check.images[i].is_wrong) wrong.push_back(static_cast<int32_t>(i));
  }
  return wrong;
}

TEST(CheckPairs, FindsNothingWrongWithRightPosesAndMeasuresTheNoise) {
  const Model model = Scene();
  const PairCheck check = CheckPairs(model, DatabaseOf(model));
  EXPECT_GT(check.num_kept, 30);
  EXPECT_EQ(check.num_contradictory, 0);
  EXPECT_EQ(check.num_undecided, 0);
  EXPECT_THAT(WrongImages(check), IsEmpty());
  EXPECT_EQ(check.cheapest.cost, 0);
  EXPECT_FALSE(check.runner_up);
  EXPECT_NEAR(check.noise_px, 0.5, 0.03);
  int64_t agreeing = 0, of = 0;
  for (const CheckedPair& pair : check.pairs) {
    if (pair.state == PairState::kNotChecked) continue;
    agreeing += pair.num_agreeing;
    of += pair.num_matches;
  }
  EXPECT_EQ(agreeing, of);
}

TEST(CheckPairs, TellsAMovedImageFromATurnedOneAndSaysHowFar) {
  Model model = Scene();
  const Database database = DatabaseOf(model);
  Change(4, 0, 0.05, &model);
  Change(8, 2, 0, &model);
  const PairCheck check = CheckPairs(model, database);
  EXPECT_THAT(WrongImages(check), ElementsAre(4, 8));
  EXPECT_THAT(check.cheapest.images, ElementsAre(4, 8));
  EXPECT_EQ(check.images[4].fault, PoseFault::kPosition);
  EXPECT_NEAR(check.images[4].moved_by, 0.05, 0.002);
  EXPECT_EQ(check.images[8].fault, PoseFault::kRotation);
  EXPECT_NEAR(check.images[8].turned_by_deg, 2, 0.05);
  for (const CheckedPair& pair : check.pairs) {
    EXPECT_FALSE(pair.has_wrong_matches);
    if (pair.state != PairState::kContradictory) continue;
    EXPECT_GE(pair.most_explained, pair.num_explained);
    EXPECT_GE(pair.num_explained, pair.num_agreeing);
    // A position that is wrong leaves a baseline for all matches.
    if (pair.image1 != 8 && pair.image2 != 8) {
      EXPECT_EQ(pair.num_explained, pair.num_matches);
    }
  }
}

TEST(CheckPairs, BlamesTheMatchesOfASinglePairThatContradicts) {
  const Model model = Scene();
  Database database = DatabaseOf(model);
  auto worst =
      std::max_element(database.pairs.begin(), database.pairs.end(),
                       [](const VerifiedPair& a, const VerifiedPair& b) {
                         return a.matches.size() < b.matches.size();
                       });
  // Each match goes to the keypoint of the next.
  auto& matches = worst->matches;
  for (size_t k = 0; k + 1 < matches.size(); ++k) {
    std::swap(matches[k][1], matches[k + 1][1]);
  }
  const PairCheck check = CheckPairs(model, database);
  EXPECT_THAT(WrongImages(check), IsEmpty());
  EXPECT_EQ(check.num_contradictory, 1);
  EXPECT_TRUE(check.pairs[worst - database.pairs.begin()].has_wrong_matches);
  EXPECT_EQ(check.cheapest.cost, static_cast<int64_t>(matches.size()));
}

// So that most of its matches agree.
TEST(CheckPairs, FindsAnImageThatIsTurnedOrMovedWithinTheTolerance) {
  const Model model = Scene();
  const Database database = DatabaseOf(model);
  for (const bool is_turned : {true, false}) {
    Model changed = model;
    Change(4, is_turned ? 0.12 : 0, is_turned ? 0 : 0.004, &changed);
    const PairCheck check = CheckPairs(changed, database);
    EXPECT_GT(check.images[4].kept_matches,
              check.images[4].contradictory_matches);
    EXPECT_THAT(WrongImages(check), ElementsAre(4));
    EXPECT_THAT(check.cheapest.images, ElementsAre(4));
    EXPECT_EQ(check.images[4].fault,
              is_turned ? PoseFault::kRotation : PoseFault::kPosition);
    if (is_turned) {
      EXPECT_NEAR(check.images[4].turned_by_deg, 0.12, 0.01);
    } else {
      EXPECT_NEAR(check.images[4].moved_by, 0.004, 0.0004);
    }
  }
}

// That no baseline explains them says nothing of a rotation.
TEST(CheckPairs, ProvesNoRotationWrongByMatchesThatAreWrong) {
  Model model = Scene();
  Database database = DatabaseOf(model);
  for (VerifiedPair& pair : database.pairs) {
    if (pair.image1 != 4) continue;
    for (size_t k = 0; k + 1 < pair.matches.size(); ++k) {
      std::swap(pair.matches[k][1], pair.matches[k + 1][1]);
    }
    break;
  }
  Change(4, 0, 0.008, &model);
  const PairCheck check = CheckPairs(model, database);
  EXPECT_EQ(check.num_contradictory, 1);
  EXPECT_THAT(WrongImages(check), ElementsAre(4));
  EXPECT_EQ(check.images[4].fault, PoseFault::kPosition);
  EXPECT_FALSE(check.images[4].is_rotation_proved_wrong);
}

// As a model that is not adjusted.
TEST(CheckPairs, CallsNoImageMisplacedWhereMostWouldFitBetterElsewhere) {
  Model model = Scene();
  const Database database = DatabaseOf(model);
  for (int image = 0; image < 12; ++image) {
    Change(image, image % 2 == 0 ? 0.12 : -0.12, 0, &model);
  }
  EXPECT_THAT(WrongImages(CheckPairs(model, database)), IsEmpty());
}

// Of a scene with structures that look alike.
TEST(CheckPairs, BlamesNoImageThatMostOfItsMatchesContradictAndNoPoseFits) {
  const Model model = Scene();
  Database database = DatabaseOf(model);
  int64_t wrong = 0, right = 0;
  for (VerifiedPair& pair : database.pairs) {
    if (pair.image1 != 3 && pair.image2 != 3) continue;
    auto& matches = pair.matches;
    if (wrong > 2 * right) {
      right += static_cast<int64_t>(matches.size());
      continue;
    }
    wrong += static_cast<int64_t>(matches.size());
    for (size_t k = 0; k + 1 < matches.size(); ++k) {
      std::swap(matches[k][1], matches[k + 1][1]);
    }
  }
  ASSERT_GT(2 * wrong, 3 * right);
  const PairCheck check = CheckPairs(model, database);
  EXPECT_GT(check.images[3].contradictory_matches,
            check.images[3].kept_matches);
  EXPECT_THAT(WrongImages(check), IsEmpty());
  EXPECT_THAT(check.cheapest.images, IsEmpty());
}

TEST(CheckPairs, NamesGroupsThatAgreeInsideAndContradictEachOther) {
  Model model = Scene();
  Database database = DatabaseOf(model);
  // Of the pairs between the two halves few are left, so that no image pays.
  const auto is_between = [](const VerifiedPair& pair) {
    return pair.image1 < 6 && pair.image2 >= 6;
  };
  int num_between = 0;
  database.pairs.erase(
      std::remove_if(database.pairs.begin(), database.pairs.end(),
                     [&](const VerifiedPair& pair) {
                       return is_between(pair) && ++num_between % 5 != 0;
                     }),
      database.pairs.end());
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.1, Eigen::Vector3d(0.3, 1, 0.2).normalized())
          .toRotationMatrix();
  for (int image = 6; image < 12; ++image) {
    Pose& pose =
        model.frames[ImageGeometries(model)[image].frame].rig_from_world;
    pose = ToPose(pose.Transform() *
                  RigidTransform{turn, Eigen::Vector3d(0.1, 0.2, 0)});
  }
  const PairCheck check = CheckPairs(model, database);
  EXPECT_THAT(WrongImages(check), IsEmpty());
  EXPECT_GT(check.num_contradictory, 0);
  EXPECT_THAT(check.groups, ElementsAre(ElementsAre(0, 1, 2, 3, 4, 5),
                                        ElementsAre(6, 7, 8, 9, 10, 11)));
  EXPECT_TRUE(check.IsAnythingWrong());
  for (const CheckedPair& pair : check.pairs) {
    EXPECT_FALSE(pair.has_wrong_matches);
  }
}

TEST(CheckPairs, ChecksNeitherFewMatchesNorImagesWithoutPoseOrBaseline) {
  Model model = Scene();
  Database database = DatabaseOf(model);
  database.pairs.resize(3);
  database.pairs[0].matches.resize(14);
  const auto geometries = ImageGeometries(model);
  const auto frame_of = [&](int32_t image) -> Frame& {
    return model.frames[geometries[image].frame];
  };
  const int32_t without_pose = database.pairs[1].image2;
  const int32_t same_place = database.pairs[2].image2;
  ASSERT_NE(without_pose, same_place);
  frame_of(without_pose).rig_from_world.translation.x() =
      std::numeric_limits<double>::quiet_NaN();
  frame_of(same_place).rig_from_world =
      frame_of(database.pairs[2].image1).rig_from_world;
  const PairCheck check = CheckPairs(model, database);
  EXPECT_EQ(check.num_not_checked, 3);
  EXPECT_THAT(WrongImages(check), IsEmpty());
  EXPECT_EQ(CheckPairs(model, Database{}).pairs.size(), 0);
}

TEST(CheckPairs, SaysTheSameAtAnyNumberOfThreads) {
  Model model = Scene();
  const Database database = DatabaseOf(model);
  Change(4, 1, 0.02, &model);
  const PairCheck a = CheckPairs(model, database, {1});
  const PairCheck b = CheckPairs(model, database, {3});
  EXPECT_EQ(a.tolerance_px, b.tolerance_px);
  for (size_t p = 0; p < a.pairs.size(); ++p) {
    EXPECT_EQ(a.pairs[p].state, b.pairs[p].state);
    EXPECT_EQ(a.pairs[p].num_explained, b.pairs[p].num_explained);
  }
  EXPECT_EQ(a.images[4].turned_by_deg, b.images[4].turned_by_deg);
  EXPECT_EQ(a.images[4].moved_by, b.images[4].moved_by);
}

// How many of the planted images were found, of how many; and how many others.
struct Tally {
  int found = 0, planted = 0, alarms = 0, right_faults = 0;
};

Tally Plant(const Model& model, const Database& database, double turn_deg,
            double shift, int num_seeds) {
  Tally tally;
  std::mt19937 random(7);
  for (int seed = 0; seed < num_seeds; ++seed) {
    Model changed = model;
    std::set<int32_t> planted;
    while (planted.size() < static_cast<size_t>(1 + seed % 5)) {
      planted.insert(static_cast<int32_t>(random() % model.images.size()));
    }
    for (const int32_t i : planted) Change(i, turn_deg, shift, &changed);
    const PairCheck check = CheckPairs(changed, database);
    tally.planted += static_cast<int>(planted.size());
    for (const int32_t i : WrongImages(check)) {
      const bool is_planted = planted.count(i) > 0;
      ++(is_planted ? tally.found : tally.alarms);
      tally.right_faults +=
          is_planted &&
          check.images[i].fault ==
              (turn_deg > 0 ? PoseFault::kRotation : PoseFault::kPosition);
    }
  }
  return tally;
}

TEST(CheckPairs, OfARealDatabaseFindsWhatWasPlantedAndNothingElse) {
  if (!RealModels()) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  const auto folder = *RealModels() / "herzjesu25";
  const Model model = ReadModel(folder, ModelFormat::kBinary);
  const Database database = ReadDatabase(folder / "database.db", model);
  const PairCheck check = CheckPairs(model, database);
  EXPECT_EQ(check.num_kept, 249);
  EXPECT_EQ(check.num_contradictory, 0);
  EXPECT_THAT(WrongImages(check), IsEmpty());
  EXPECT_NEAR(check.noise_px, 0.5, 0.1);

  const Tally turned = Plant(model, database, 1, 0, 5);
  EXPECT_GE(turned.found, 0.9 * turned.planted);
  EXPECT_EQ(turned.alarms, 0);
  EXPECT_EQ(turned.right_faults, turned.found);
  const Tally moved = Plant(model, database, 0, 0.3, 5);
  EXPECT_GE(moved.found, 0.9 * moved.planted);
  EXPECT_EQ(moved.alarms, 0);
  EXPECT_EQ(moved.right_faults, moved.found);
}

}  // namespace
}  // namespace krot::internal
