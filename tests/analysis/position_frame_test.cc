#include "krot/analysis/model_input.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/context.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

// Cameras around a square, a viewing distance being 50 m, and what a receiver
// in a frame of its own says of them.
class Town {
 public:
  Town(int num_cameras, unsigned seed) : random_(seed) {
    SceneOptions options = SceneOf(num_cameras, 60);
    options.has_rigs = false;
    options.start_translation_noise = 1e-4;
    options.start_point_noise = 1e-4;
    options.random_seed = seed;
    const SyntheticScene scene = SynthesizeScene(options);
    model = scene.model;
    own_from_model.scale = 50;
    own_from_model.rotation =
        Eigen::Quaterniond(Normal(), Normal(), Normal(), Normal())
            .normalized()
            .matrix();
    own_from_model.translation = {454000.25, 5412000.5, 310.125};
    for (const ImageGeometry& image : ImageGeometries(scene.ground_truth)) {
      truth.push_back(own_from_model * Center(image.cam_from_world));
    }
  }

  // Off by a Gaussian in the radius, and `share` of them wrong by 10 to 1,000 m
  // more.
  void Survey(double radius, double share) {
    positions.clear();
    wrong.clear();
    std::vector<size_t> order(truth.size());
    for (size_t n = 0; n < order.size(); ++n) order[n] = n;
    std::shuffle(order.begin(), order.end(), random_);
    order.resize(static_cast<size_t>(
        std::lround(share * static_cast<double>(truth.size()))));
    wrong.insert(order.begin(), order.end());
    for (size_t n = 0; n < truth.size(); ++n) {
      Vector3d off = Vector3d::Constant(2 * radius);
      while (off.norm() > radius) off = radius / 3 * Normal3();
      if (wrong.count(n) > 0) {
        off += std::pow(10, 1 + 2 * std::abs(std::sin(7 * Normal()))) *
               Normal3().normalized();
      }
      positions.push_back({KnownPosition::Of::kImage, static_cast<int32_t>(n),
                           BallAround(truth[n] + off, radius)});
    }
  }

  PositionFrame Find() const {
    return FindPositionFrame(model, positions, "gps.txt");
  }

  double Normal() { return std::normal_distribution<double>()(random_); }
  Vector3d Normal3() {
    const double x = Normal(), y = Normal(), z = Normal();
    return {x, y, z};
  }

  Model model;
  Similarity own_from_model;
  std::vector<Vector3d> truth;  // of each image, in the own frame
  std::vector<KnownPosition> positions;
  std::set<size_t> wrong;

 private:
  std::mt19937 random_;
};

std::string RefusalOf(const Town& town) {
  return ModelErrorOf([&] { town.Find(); });
}

struct Counts {
  double wrong = 0;
  double named = 0;
  double both = 0;
};

Counts CountNamed(const Town& town, const PositionFrame& frame) {
  Counts counts;
  counts.wrong = static_cast<double>(town.wrong.size());
  for (const WrongPosition& position : frame.wrong) {
    ++counts.named;
    counts.both += static_cast<double>(town.wrong.count(position.index));
  }
  return counts;
}

class FindPositionFrameAtRadius : public testing::TestWithParam<double> {};

// With a radius of 5 m some that are off by little more than 10 m agree.
TEST_P(FindPositionFrameAtRadius, NamesTheWrongPositionsOfTownsAndNoOthers) {
  const double radius = GetParam();
  Counts all;
  for (unsigned seed = 1; seed <= 50; ++seed) {
    Town town(10 + static_cast<int>(seed * 7 % 51), seed);
    town.Survey(radius, 0.1 * (seed % 5));
    const PositionFrame frame = town.Find();
    const Counts counts = CountNamed(town, frame);
    all.wrong += counts.wrong;
    all.named += counts.named;
    all.both += counts.both;
    EXPECT_EQ(frame.positions.size() + frame.wrong.size(),
              town.positions.size());
    // Six standard deviations of a scale from this many positions, and those of
    // the model's own noise, at an RMS distance of 0.5 or more.
    const double count = static_cast<double>(frame.positions.size());
    EXPECT_NEAR(frame.own_from_model.scale / 50, 1,
                6 * (radius / 3 / 50 + 1e-4) / (0.5 * std::sqrt(count)));
  }
  EXPECT_GE(all.both, (radius < 5 ? 1.0 : 0.95) * all.wrong);
  EXPECT_GE(all.both, 0.98 * all.named);
}

INSTANTIATE_TEST_SUITE_P(FromCentimetresToMetres, FindPositionFrameAtRadius,
                         testing::Values(0.02, 0.1, 0.5, 2.0, 5.0));

TEST(FindPositionFrame, LosesNoDigitsFarFromTheOrigin) {
  Town town(20, 3);
  for (size_t n = 0; n < town.truth.size(); ++n) {
    const Vector3d place =
        Center(ImageGeometries(town.model)[n].cam_from_world);
    town.positions.push_back({KnownPosition::Of::kImage,
                              static_cast<int32_t>(n),
                              BallAround(town.own_from_model * place, 1e-3)});
  }
  const PositionFrame frame = town.Find();
  // Coordinates of 5e6 m are known to 1e-9 m.
  EXPECT_NEAR(frame.own_from_model.scale, 50, 50 * 1e-9);
  EXPECT_TRUE(frame.wrong.empty());
  for (const KnownPosition& position : frame.positions) {
    const Vector3d place =
        Center(ImageGeometries(town.model)[position.index].cam_from_world);
    EXPECT_LE((position.region.centre - place).norm(), 1e-9);
    EXPECT_NEAR(position.region.semi_axes[0], 1e-3 / 50, 1e-12);
    EXPECT_LE((frame.own_from_model * place -
               town.positions[position.index].region.centre)
                  .norm(),
              1e-8);
  }
}

TEST(FindPositionFrame, TurnsEllipsoidsWithTheFrame) {
  Town town(12, 5);
  town.Survey(0.1, 0);
  for (KnownPosition& position : town.positions) {
    position.region.semi_axes = {0.1, 0.2, 0.4};
    position.region.world_from_axes = Eigen::Quaterniond(
        town.Normal(), town.Normal(), town.Normal(), town.Normal());
  }
  const PositionFrame frame = town.Find();
  ASSERT_EQ(frame.positions.size(), town.positions.size());
  for (size_t n = 0; n < frame.positions.size(); ++n) {
    const Ellipsoid& own = town.positions[n].region;
    const Ellipsoid& in_model = frame.positions[n].region;
    for (int trial = 0; trial < 5; ++trial) {
      const Vector3d place = in_model.centre + 0.01 * town.Normal3();
      EXPECT_NEAR(
          (in_model.UnitFromWorld() * (place - in_model.centre)).norm(),
          (own.UnitFromWorld() * (frame.own_from_model * place - own.centre))
              .norm(),
          1e-6);
    }
  }
}

TEST(FindPositionFrame, TakesRadiiFromTheScatterWhereThereAreNone) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Town town(30, seed);
    town.Survey(0.5, 0.3);
    for (KnownPosition& position : town.positions) {
      position.region.semi_axes.setZero();
    }
    const PositionFrame frame = town.Find();
    ASSERT_TRUE(frame.radius);
    // A sixth of a metre per axis: 2.6 medians are 0.67 m.
    EXPECT_GT(*frame.radius, 0.4);
    EXPECT_LT(*frame.radius, 1.2);
    const Counts counts = CountNamed(town, frame);
    EXPECT_EQ(counts.both, counts.wrong);
    EXPECT_LE(counts.named, counts.wrong + 1);
  }
}

TEST(FindPositionFrame, GoesByTheScatterWhereRadiiAreTooSmall) {
  Town town(40, 2);
  town.Survey(0.5, 0.25);
  for (KnownPosition& position : town.positions) {
    position.region.semi_axes.setConstant(0.01);
  }
  const PositionFrame frame = town.Find();
  EXPECT_GT(frame.tolerance, 10);
  EXPECT_FALSE(frame.radius);
  const Counts counts = CountNamed(town, frame);
  EXPECT_EQ(counts.both, counts.wrong);
  EXPECT_LE(counts.named, counts.wrong + 1);
}

TEST(FindPositionFrame, TrustsSmallRadiiMoreThanLargeOnes) {
  Town town(24, 9);
  town.Survey(0.02, 0);
  const std::vector<KnownPosition> exact = town.positions;
  town.Survey(5, 0);
  for (size_t n = 0; n < 6; ++n) town.positions[n] = exact[n];
  const PositionFrame frame = town.Find();
  EXPECT_NEAR(frame.own_from_model.scale / 50, 1, 1e-3);
}

TEST(FindPositionFrame, TakesThePlacesOfPointsAsWell) {
  Town town(10, 4);
  town.positions.clear();
  for (int32_t k = 0; k < 8; ++k) {
    town.positions.push_back(
        {KnownPosition::Of::kPoint3D, k,
         BallAround(town.own_from_model * town.model.points3D[k].xyz, 0.1)});
  }
  town.positions[3].region.centre.z() += 40;
  const PositionFrame frame = town.Find();
  ASSERT_EQ(frame.wrong.size(), 1u);
  EXPECT_EQ(frame.wrong[0].name,
            "3D point " + std::to_string(town.model.points3D[3].id));
  EXPECT_NEAR(frame.wrong[0].distance, 40, 0.1);
}

TEST(FindPositionFrame, FindsItAmongHundredsWithFortyPercentWrong) {
  Town town(600, 6);
  town.Survey(0.5, 0.4);
  const PositionFrame frame = town.Find();
  const Counts counts = CountNamed(town, frame);
  EXPECT_EQ(counts.both, counts.wrong);
  EXPECT_GE(counts.both, 0.98 * counts.named);
}

TEST(FindPositionFrame, RefusesFewerThanThree) {
  Town town(10, 1);
  town.Survey(0.5, 0);
  town.positions.resize(2);
  EXPECT_THAT(RefusalOf(town),
              HasSubstr("gps.txt: found 2 positions of what the model places, "
                        "expected three at least"));
}

TEST(FindPositionFrame, RefusesPositionsOnALineUpToTheirScatter) {
  for (const double beside : {0.0, 0.001}) {
    Town town(20, 8);
    const Eigen::Matrix3d model_from_own =
        town.own_from_model.rotation.transpose() / town.own_from_model.scale;
    town.positions.clear();
    for (size_t n = 0; n < town.model.images.size(); ++n) {
      const Vector3d place(5.0 * static_cast<double>(n), beside * town.Normal(),
                           beside * town.Normal());
      Image& image = town.model.images[n];
      Vector3d in_model = model_from_own * place;
      image.cam_from_world.translation =
          -(image.cam_from_world.Rotation() * in_model);
      for (Frame& frame : town.model.frames) {
        if (frame.data.size() != 1 || frame.data[0].data_id != image.id) {
          continue;
        }
        frame.rig_from_world.translation = image.cam_from_world.translation;
      }
      town.positions.push_back(
          {KnownPosition::Of::kImage, static_cast<int32_t>(n),
           BallAround(place + 0.1 * beside / 0.001 * town.Normal3(), 0.5)});
    }
    EXPECT_THAT(RefusalOf(town), HasSubstr("found positions on one line"));
  }
}

TEST(FindPositionFrame, RefusesPositionsOfOtherImages) {
  for (const double radius : {0.0, 0.5}) {
    Town town(25, 7);
    town.Survey(0.5, 0);
    for (KnownPosition& position : town.positions) {
      position.region = BallAround(30 * town.Normal3(), radius);
    }
    EXPECT_THAT(RefusalOf(town),
                HasSubstr("as far as they are from each other"));
  }
}

Model RotatedScene() {
  SceneOptions options = SceneOf(8, 60, 6, 0.5);
  options.has_rigs = false;
  return SynthesizeScene(options).model;
}

FileBytes InverseRotations(const Model& model, size_t num_images = 8) {
  std::ostringstream lines;
  lines.precision(17);
  for (size_t n = 0; n < num_images; ++n) {
    const Image& image = model.images[n];
    const QuaternionWxyz& q = image.cam_from_world.quaternion_wxyz;
    lines << image.name << " " << q[0] << " " << -q[1] << " " << -q[2] << " "
          << -q[3] << "\n";
  }
  return {"r.txt", lines.str()};
}

TEST(TakeRotations, RefusesInverseOnesThatTheErrorsSpeakAgainst) {
  Model model = RotatedScene();
  const FileBytes file = InverseRotations(model);
  EXPECT_THAT(
      ModelErrorOf([&] { TakeRotations(file, &model); }),
      ::testing::AllOf(HasSubstr("r.txt: found rotations that are "),
                       HasSubstr("the median error is 0."),
                       HasSubstr(" with the model's own, with these ")));
}

// Most observations are of images that it does not name.
TEST(TakeRotations, RefusesInverseOnesOfAFewImages) {
  Model model = RotatedScene();
  const FileBytes file = InverseRotations(model, 3);
  EXPECT_THAT(ModelErrorOf([&] { TakeRotations(file, &model); }),
              HasSubstr("r.txt: found rotations that are "));
}

// The list is right, and the model's own rotations are the inverse ones.
TEST(TakeRotations, DoesNotRefuseWhereTheModelFitsNoBetter) {
  Model model = RotatedScene();
  const Model sound = model;
  for (Image& image : model.images) {
    QuaternionWxyz& q = image.cam_from_world.quaternion_wxyz;
    q = {q[0], -q[1], -q[2], -q[3]};
  }
  UseTrivialRigs(&model);
  const FileBytes file = InverseRotations(model);
  const RotationInput input = TakeRotations(file, &model);
  EXPECT_NE(input.replaced.mistake, "");
  for (size_t n = 0; n < sound.images.size(); ++n) {
    EXPECT_EQ(model.images[n].cam_from_world.quaternion_wxyz,
              sound.images[n].cam_from_world.quaternion_wxyz);
  }
}

TEST(TakeRotations, MeasuresWhatTheyDoToTheErrors) {
  Model model = RotatedScene();
  std::string lines;
  for (const Image& image : model.images) lines += image.name + " 1 0 0 0\n";
  const RotationInput input = TakeRotations({"r.txt", lines}, &model);
  EXPECT_EQ(input.replaced.mistake, "");
  ASSERT_TRUE(input.median_error_before);
  EXPECT_LT(*input.median_error_before, 1);
  EXPECT_TRUE(!input.median_error_after ||
              *input.median_error_after > 10 * *input.median_error_before);
}

}  // namespace
}  // namespace krot::internal
