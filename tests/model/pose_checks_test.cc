#include "krot/model/model_checks.h"

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model/rigs.h"
#include "tests/model/tiny_model.h"

namespace krot::internal {
namespace {

using Eigen::Quaterniond;
using ::testing::HasSubstr;
using Rotations = std::vector<Quaterniond>;
using Numbers = std::vector<QuaternionWxyz>;

Rotations RandomRotations(int count) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  Rotations rotations;
  for (int n = 0; n < count; ++n) {
    rotations.push_back(Quaterniond(normal(random), normal(random),
                                    normal(random), normal(random))
                            .normalized());
  }
  return rotations;
}

Quaterniond Noise(double angle_deg, int n) {
  const Eigen::Vector3d axis(std::sin(n), std::cos(n), std::sin(2.0 * n));
  return Quaterniond(
      Eigen::AngleAxisd(angle_deg * M_PI / 180, axis.normalized()));
}

// What a tool writes that has other conventions than COLMAP.
struct Writer {
  bool is_inverse;
  bool looks_along_minus_z;
  bool writes_w_last;
};

QuaternionWxyz Written(const Writer& writer, Quaterniond cam_from_world) {
  if (writer.looks_along_minus_z) {
    const Quaterniond half_turn(0, 1, 0, 0);  // y and z change their signs
    cam_from_world = half_turn * cam_from_world;
  }
  const Quaterniond q =
      writer.is_inverse ? cam_from_world.conjugate() : cam_from_world;
  if (writer.writes_w_last) return {q.x(), q.y(), q.z(), q.w()};
  return {q.w(), q.x(), q.y(), q.z()};
}

// The four numbers in the order that the sentence asks for: "-b a -d c".
Quaterniond Rewritten(const QuaternionWxyz& numbers,
                      const std::string& sentence) {
  const std::string mark = "are written ";
  size_t at = sentence.find(mark) + mark.size();
  QuaternionWxyz wxyz;
  for (double& value : wxyz) {
    const bool is_negative = sentence.at(at) == '-';
    if (is_negative) ++at;
    const double number = numbers[static_cast<size_t>(sentence.at(at) - 'a')];
    value = is_negative ? -number : number;
    at += 2;
  }
  return NormalizedQuaternion(wxyz);
}

TEST(CompareRotations, NamesTheOrderInWhichOtherConventionsWouldFit) {
  const Rotations own = RandomRotations(30);
  const Quaterniond world_turn = Noise(50, 3);
  for (int writer = 1; writer < 8; ++writer) {
    const Writer conventions = {(writer & 1) != 0, (writer & 2) != 0,
                                (writer & 4) != 0};
    Numbers listed;
    Rotations wanted;
    for (int n = 0; n < 30; ++n) {
      wanted.push_back(Noise(1, n) * own[static_cast<size_t>(n)] * world_turn);
      listed.push_back(Written(conventions, wanted.back()));
    }
    const RotationAgreement agreement = CompareRotations(own, listed);
    EXPECT_FALSE(agreement.own_world_from_list);
    ASSERT_THAT(agreement.mistake, HasSubstr("are written ")) << writer;
    for (size_t n = 0; n < listed.size(); ++n) {
      EXPECT_LT(AngleDeg(Rewritten(listed[n], agreement.mistake), wanted[n]),
                1e-6)
          << writer << ": " << agreement.mistake;
    }
  }
}

TEST(CompareRotations, FindsTheWorldFrameOfAListWithAThirdOfItWrong) {
  const Rotations own = RandomRotations(60);
  const Quaterniond world_turn = Noise(100, 5);
  Numbers listed;
  for (int n = 0; n < 60; ++n) {
    const Quaterniond error = Noise(n % 3 == 0 ? 70 : 0.2, n);
    listed.push_back(
        Written({}, error * own[static_cast<size_t>(n)] * world_turn));
  }
  const RotationAgreement agreement = CompareRotations(own, listed);
  EXPECT_EQ(agreement.mistake, "");
  ASSERT_TRUE(agreement.own_world_from_list);
  EXPECT_LT(AngleDeg(*agreement.own_world_from_list, world_turn), 0.2);
}

TEST(CompareRotations, HasNothingToSayOfListsThatAreMerelyInexact) {
  const Rotations own = RandomRotations(40);
  for (const double error_deg : {0.0, 0.3, 5.0, 20.0}) {
    Numbers listed;
    for (int n = 0; n < 40; ++n) {
      listed.push_back(
          Written({}, Noise(error_deg, n) * own[static_cast<size_t>(n)]));
    }
    const RotationAgreement agreement = CompareRotations(own, listed);
    EXPECT_EQ(agreement.mistake, "") << error_deg;
    EXPECT_FALSE(agreement.own_world_from_list) << error_deg;
  }
}

// Frames with one image each, in random poses.
Model Posed(int num_images) {
  const Rotations rotations = RandomRotations(num_images);
  Model model;
  model.cameras = {{1, 0, 100, 100, {80, 50, 50}}};
  for (int n = 0; n < num_images; ++n) {
    Image image;
    image.id = static_cast<ImageId>(n + 1);
    image.camera_id = 1;
    image.name = "img" + std::to_string(n + 1);
    image.cam_from_world = {ToWxyz(rotations[static_cast<size_t>(n)]),
                            {0.5 * n, 2, 5}};
    model.images.push_back(image);
  }
  UseTrivialRigs(&model);
  return model;
}

TEST(CheckPoses, CountsQuaternionsFarFromUnitLength) {
  Model model = Posed(5);
  EXPECT_FALSE(CheckPoses(model).Any());
  for (double& number : model.images[1].cam_from_world.quaternion_wxyz) {
    number *= 1.005;  // three digits
  }
  for (double& number : model.images[3].cam_from_world.quaternion_wxyz) {
    number *= 4;
  }
  UseTrivialRigs(&model);
  const PoseChecks checks = CheckPoses(model);
  EXPECT_EQ(checks.num_images, 5);
  EXPECT_EQ(checks.num_far_quaternions, 1);
  EXPECT_EQ(checks.first_far, "img4");
  EXPECT_NEAR(checks.shortest, 4, 1e-12);
  EXPECT_NEAR(checks.longest, 4, 1e-12);
  EXPECT_FALSE(checks.is_exchanged);
}

TEST(CheckPoses, RecognisesTranslationsInFrontOfQuaternions) {
  Model model = Posed(5);
  for (Image& image : model.images) {
    const QuaternionWxyz q = image.cam_from_world.quaternion_wxyz;
    const Eigen::Vector3d t = image.cam_from_world.translation;
    image.cam_from_world = {{t[0], t[1], t[2], q[0]}, {q[1], q[2], q[3]}};
  }
  UseTrivialRigs(&model);
  const PoseChecks checks = CheckPoses(model);
  EXPECT_EQ(checks.num_far_quaternions, 5);
  EXPECT_TRUE(checks.is_exchanged);
}

TEST(CheckPoses, FindsImagesThatDoNotStandWhereTheirFramesDo) {
  Model model = Posed(6);
  model.stores_rigs = true;
  EXPECT_FALSE(CheckPoses(model).Any());
  for (const size_t n : {1, 2, 4}) {
    Pose& pose = model.images[n].cam_from_world;
    const double angle_deg = 10 * static_cast<double>(n);
    pose.quaternion_wxyz = ToWxyz(Noise(angle_deg, 1) *
                                  NormalizedQuaternion(pose.quaternion_wxyz));
  }
  model.images[5].cam_from_world.translation.x() += 1;
  model.images[0].cam_from_world.translation.x() += 1e-6;  // rounded
  const PoseChecks checks = CheckPoses(model);
  EXPECT_EQ(checks.num_stale, 4);
  EXPECT_NEAR(checks.median_turn_deg, 20, 1e-9);
  EXPECT_NEAR(checks.largest_turn_deg, 40, 1e-9);
  EXPECT_EQ(checks.largest_turn_image, "img5");
  model.stores_rigs = false;  // no frames in the files
  EXPECT_EQ(CheckPoses(model).num_stale, 0);
}

TEST(CheckPoses, LooksAtPosedImagesAlone) {
  const PoseChecks checks = CheckPoses(TinyModel());
  EXPECT_EQ(checks.num_images, 2);
  EXPECT_EQ(checks.num_far_quaternions, 1);
  EXPECT_EQ(checks.first_far, "c.jpg");
}

}  // namespace
}  // namespace krot::internal
