#include "krot/model/model_io.h"

#include <cmath>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/base/numbers.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

using ::testing::HasSubstr;

// What programs write: "NAME X Y Z RADIUS" of the images of TinyModel.

std::string PositionsError(const std::string& text,
                           const PositionsOptions& options = {},
                           const Model& model = TinyModel()) {
  return ModelErrorOf([&] { ReadPositions({"p.txt", text}, model, options); });
}

void ExpectBall(const KnownPosition& position, int32_t index,
                const Eigen::Vector3d& centre, double radius) {
  EXPECT_EQ(position.index, index);
  EXPECT_EQ(position.region.centre, centre);
  EXPECT_EQ(position.region.semi_axes, Eigen::Vector3d::Constant(radius));
}

TEST(PositionsFile, IsReadWithBlanksTabsCommasSemicolonsAndQuotes) {
  for (const char* line :
       {"left/a b.jpg 1 -2.5 3e1 0.5", "left/a b.jpg\t1\t-2.5\t3e1\t.5\r",
        "left/a b.jpg,1,-2.5,3e1,0.5", "left/a b.jpg, 1, -2.5, 3e1, 0.5,",
        "left/a b.jpg;1;-2.5;30.0;0.5", "\"left/a b.jpg\",1,-2.5,3e1,0.5",
        "\"left/a b.jpg\",\"1\",\"-2.5\",\"30\",\"0.5\"",
        "\xef\xbb\xbfleft/a b.jpg 1 -2.5 30 0.5",
        "name x y z radius\nleft/a b.jpg 1 -2.5 30 0.5",
        "image,X (m),Y (m),Z (m),accuracy\n\nleft/a b.jpg,1,-2.5,30,0.5"}) {
    SCOPED_TRACE(line);
    const auto positions = ReadPositions({"p.txt", line}, TinyModel());
    ASSERT_EQ(positions.size(), 1);
    ExpectBall(positions[0], 0, {1, -2.5, 30}, 0.5);
  }
}

TEST(PositionsFile, TakesThePathsOfOtherProgramsForTheNamesTheyEndWith) {
  Model model = TinyModel();
  std::string notes;
  const auto read = [&](const std::string& name) {
    notes.clear();
    return ReadPositions({"p.txt", name + " 1 2 3 4"}, model,
                         {{}, [&](const std::string& text) { notes += text; }})
        .at(0)
        .index;
  };
  EXPECT_EQ(read("D:/Project data\\left\\a b.jpg"), 0);
  EXPECT_THAT(notes, HasSubstr("\"D:/Project data\\left\\a b.jpg\" for "
                               "\"left/a b.jpg\", for one"));
  EXPECT_EQ(read("./c.jpg"), 2);
  EXPECT_EQ(read("c.jpg"), 2);
  EXPECT_EQ(notes, "");
  // The longest name that is there.
  model.images[1].name = "a b.jpg";
  EXPECT_EQ(read("/x/left/a b.jpg"), 0);
  EXPECT_EQ(read("/x/right/a b.jpg"), 1);
}

TEST(PositionsFile, SkipsAndCountsWhatTheModelDoesNotHave) {
  std::string notes;
  const auto positions = ReadPositions(
      {"p.txt", "d.jpg 1 2 3 4\nc.jpg 1 2 3 4\ne.jpg 1 2 3 4\n"}, TinyModel(),
      {{}, [&](const std::string& text) { notes += text; }});
  ASSERT_EQ(positions.size(), 1);
  ExpectBall(positions[0], 2, {1, 2, 3}, 4);
  EXPECT_EQ(notes,
            "p.txt: skipped 2 of 3 lines, whose image the model does not have; "
            "the first has image \"d.jpg\"");
  EXPECT_EQ(PositionsError("d.jpg 1 2 3 4\ne.jpg 1 2 3 4\n"),
            "p.txt: found no image of the model in its 2 lines, the first has "
            "image \"d.jpg\"; expected those of the model, such as image "
            "\"left/a b.jpg\"");
  EXPECT_EQ(ModelErrorOf([] {
              ReadPointPositions({"p.txt", "99,1,2,3,4"}, TinyModel());
            }),
            "p.txt: found no 3D point of the model in its 1 line, the first "
            "has 3D point 99; expected those of the model, such as 3D point "
            "5000000000");
}

TEST(PositionsFile, WithoutRadiiTakesTheOneThatIsGiven) {
  EXPECT_EQ(
      PositionsError("c.jpg 1 2 3\n"),
      "p.txt:1: found no RADIUS behind X Y Z, expected X Y Z RADIUS, or X "
      "Y Z and three semi-axes, or these and QW QX QY QZ; "
      "--Problem.position_radius gives one to all such lines");
  const auto positions =
      ReadPositions({"p.txt", "c.jpg 1 2 3\nempty.png 4 5 6 7\n"}, TinyModel(),
                    PositionsOptions{0.25});
  ASSERT_EQ(positions.size(), 2);
  ExpectBall(positions[0], 2, {1, 2, 3}, 0.25);
  ExpectBall(positions[1], 1, {4, 5, 6}, 7);
  const auto points = ReadPointPositions({"p.txt", "12;1;2;3"}, TinyModel(),
                                         PositionsOptions{0.25});
  ASSERT_EQ(points.size(), 1);
  ExpectBall(points[0], 2, {1, 2, 3}, 0.25);
}

TEST(PositionsFile, OfNamesThatEndInNumbersLeavesANameOfTheModel) {
  Model model = TinyModel();
  model.images[0].name = "shot 5";
  model.images[1].name = "shot";
  const auto positions =
      ReadPositions({"p.txt", "shot 5 1 2 3 4\nshot 1 2 3 4\n"}, model);
  ASSERT_EQ(positions.size(), 2);
  ExpectBall(positions[0], 0, {1, 2, 3}, 4);
  ExpectBall(positions[1], 1, {1, 2, 3}, 4);
}

TEST(PositionsFile, ThatCannotBeMeantIsRefusedWithItsLine) {
  for (const char* line :
       {"c.jpg 4,99 -7,4 1,37 0,5", "c.jpg;4,99;-7,4;1,37;0,5",
        "c.jpg 4,99 -7,4 1 2", "x y\nc.jpg\t1\t2\t3\t0,5"}) {
    EXPECT_THAT(PositionsError(line),
                HasSubstr("; write numbers with a decimal point, "
                          "without commas"))
        << line;
  }
  EXPECT_THAT(PositionsError("c.jpg 1 2 3 4 5"),
              HasSubstr("p.txt:1: found 5 numbers behind image \"c.jpg\", "
                        "expected X Y Z RADIUS, or"));
  EXPECT_THAT(PositionsError("c.jpg 1 2"),
              HasSubstr("found \"c.jpg\", expected a "
                        "finite number: X Y Z RADIUS"));
  // The first line is no header if it begins as others do.
  EXPECT_THAT(PositionsError("c.jpg"), HasSubstr("p.txt:1: found \"c.jpg\""));
  EXPECT_THAT(PositionsError("c.jpg 1 2 3 O.5"), HasSubstr("found \"O.5\""));
  EXPECT_THAT(PositionsError("c.jpg 1 2 3 4\nname x y z r\n"),
              HasSubstr("p.txt:2: found \"r\""));
}

// A model whose cameras and points are metres apart, and lists of places on the
// earth with the same distances.
class LatitudesAndLongitudes : public ::testing::Test {
 protected:
  LatitudesAndLongitudes() {
    model_.cameras = {{1, 0, 640, 480, {500, 320, 240}}};
    for (int n = 0; n < 8; ++n) {
      Image image;
      image.id = static_cast<ImageId>(n + 1);
      image.camera_id = 1;
      image.name = std::to_string(n) + ".jpg";
      image.cam_from_world.translation = -Place(n);
      model_.images.push_back(image);
      model_.points3D.push_back(
          {static_cast<Point3DId>(n), Place(n), {0, 0, 0}, 0, 0, 0});
    }
    UseTrivialRigs(&model_);
  }

  static Eigen::Vector3d Place(int n) {
    return {3.0 * (n % 3), 5.0 * (n % 4), 0.3 * (n % 2)};
  }

  // What reading says of `scale` * place + `origin`.
  std::string PositionsError(const Eigen::Vector3d& scale,
                             const Eigen::Vector3d& origin,
                             bool of_points = false,
                             const std::string& header = "") const {
    std::string text = header;
    for (int n = 0; n < 8; ++n) {
      const Eigen::Vector3d x = scale.cwiseProduct(Place(n)) + origin;
      text += of_points ? std::to_string(n) : model_.images[n].name;
      for (const double value : x) {
        text += ' ';
        AppendNumber(value, &text);
      }
      text += n % 2 == 0 ? " 3\n" : "\n";  // with and without a radius
    }
    return ModelErrorOf([&] {
      const PositionsOptions options{radius_};
      of_points ? ReadPointPositions({"p.txt", text}, model_, options)
                : ReadPositions({"p.txt", text}, model_, options);
    });
  }

  const Eigen::Vector3d kDegrees{1 / 111e3, 1 / 103e3, 1};
  Model model_;
  std::optional<double> radius_;
};

TEST_F(LatitudesAndLongitudes, AreRecognisedWhereverThePlaceIs) {
  for (const Eigen::Vector3d& origin :
       {Eigen::Vector3d(22.549, 114.051, 12), Eigen::Vector3d(51.5, -0.12, 40),
        Eigen::Vector3d(-33.86, 151.2, 0), Eigen::Vector3d(114.051, 22.549, 12),
        Eigen::Vector3d(0.01, 9.45, 10)}) {
    for (const bool of_points : {false, true}) {
      EXPECT_THAT(PositionsError(kDegrees, origin, of_points),
                  HasSubstr("p.txt: found latitudes and longitudes, expected X "
                            "Y Z in the model's frame and unit; "
                            "tools/scripts/geodetic_to_positions.sh"));
    }
  }
}

TEST_F(LatitudesAndLongitudes,
       AreRecognisedByTheirHeightsIfTheModelHasNoPlaces) {
  for (Image& image : model_.images) {
    image.cam_from_world.translation.setZero();
  }
  UseTrivialRigs(&model_);
  EXPECT_THAT(PositionsError(kDegrees, {22.549, 114.051, 12}),
              HasSubstr("found latitudes and longitudes"));
  radius_ = 2;
  EXPECT_EQ(PositionsError({1, 1, 1}, {22.549, 114.051, 12}), "");
}

TEST_F(LatitudesAndLongitudes, AreRecognisedByTheHeader) {
  EXPECT_THAT(PositionsError({1, 1, 1}, {0, 0, 0}, false,
                             "image Latitude Longitude h r\n"),
              HasSubstr("found latitudes and longitudes"));
}

TEST_F(LatitudesAndLongitudes, AreNotSeenInPositionsOfOtherFramesAndUnits) {
  radius_ = 2;
  for (const double unit : {1.0, 0.01, 1e-3, 1e3}) {
    for (const Eigen::Vector3d& origin :
         {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.5, -0.2, 0.1),
          Eigen::Vector3d(296227, 5707542, 87)}) {
      EXPECT_EQ(PositionsError({unit, unit, unit}, origin), "")
          << unit << " " << origin.transpose();
    }
  }
  // Far from the origin for its size, as far apart as in the model.
  EXPECT_EQ(PositionsError({0.1, 0.1, 0.1}, {80, 170, 0}), "");
  // A single place, or the same one for all, says nothing.
  EXPECT_EQ(PositionsError({0, 0, 0}, {22.549, 114.051, 12}), "");
}

std::string RotationsError(const std::string& text, Model model = TinyModel()) {
  return ModelErrorOf([&] { ReplaceRotations({"r.txt", text}, &model); });
}

const Eigen::Quaterniond kTurn =
    Eigen::Quaterniond(0.9, 0.1, -0.2, 0.3).normalized();

std::string Line(const std::string& name, const Eigen::Quaterniond& q) {
  std::ostringstream line;
  line.precision(17);
  line << name << " " << q.w() << " " << q.x() << " " << q.y() << " " << q.z()
       << "\n";
  return line.str();
}

TEST(RotationsFile, TurnsTheImagesThatItNamesAboutTheirCentres) {
  const Model before = TinyModel();
  Model after = before;
  const ReplacedRotations replaced = ReplaceRotations(
      {"r.txt", "# of a gimbal\n\n" + Line("left/a b.jpg", kTurn) +
                    Line("c.jpg", kTurn)},
      &after);
  EXPECT_EQ(replaced.num_frames, 2);
  EXPECT_EQ(replaced.num_kept_images, 1);
  ValidateModel(after);
  const auto was = ImageGeometries(before);
  const auto is = ImageGeometries(after);
  for (const int image : {0, 2}) {
    EXPECT_LT(
        (is[image].cam_from_world.rotation - kTurn.toRotationMatrix()).norm(),
        1e-15);
    const Eigen::Vector3d centre = Center(was[image].cam_from_world);
    EXPECT_LT((Center(is[image].cam_from_world) - centre).norm(),
              1e-14 * centre.norm());
    EXPECT_EQ(after.images[image].cam_from_world.quaternion_wxyz,
              after.frames[is[image].frame].rig_from_world.quaternion_wxyz);
  }
  EXPECT_EQ(is[1].rig_from_world.rotation, was[1].rig_from_world.rotation);
  EXPECT_EQ(after.images[1].cam_from_world.quaternion_wxyz,
            before.images[1].cam_from_world.quaternion_wxyz);
}

TEST(RotationsFile, TurnsAFrameThroughItsSensorsPlaceInTheRig) {
  Model model = TinyRigModel();
  const ReplacedRotations replaced =
      ReplaceRotations({"r.txt", Line("c.jpg", kTurn)}, &model);
  EXPECT_EQ(replaced.num_frames, 1);
  EXPECT_EQ(replaced.num_kept_images, 1);  // that of the other frame
  const auto geometries = ImageGeometries(model);
  for (const int image : {1, 2}) {  // "empty.png" is of the same sensor
    EXPECT_LT(
        (geometries[image].cam_from_world.rotation - kTurn.toRotationMatrix())
            .norm(),
        1e-15);
    EXPECT_LT((model.images[image].cam_from_world.Rotation() -
               kTurn.toRotationMatrix())
                  .norm(),
              1e-15);
  }
}

TEST(RotationsFile, OfTheModelsOwnRotationsChangesNoBit) {
  const Model before = TinyModel();
  Model after = before;
  ReplaceRotations(
      {"r.txt", "left/a b.jpg\t0.5 -0.5 0.5 -0.5 \r\nc.jpg +1 0 0 0"}, &after);
  EXPECT_THAT(after, IsModel(before));
}

TEST(RotationsFile, ThatCannotBeMeantIsRefusedWithItsLine) {
  EXPECT_THAT(
      RotationsError("c.jpg 1 0 0 0\nempty.png 1 0 0 0\nc.jpg 1 0 0 0\n"),
      HasSubstr("r.txt:3: found image \"c.jpg\" again, expected each "
                "once; line 1 names it"));
  EXPECT_THAT(RotationsError("c.jpg 0 0 0 0"),
              HasSubstr("r.txt:1: found a quaternion of zeros"));
  EXPECT_THAT(RotationsError("c.jpg 1 0 0 0 1 2 3"),
              HasSubstr("r.txt: found no image of the model in its 1 line, the "
                        "first has image \"c.jpg 1 0 0\""));
  EXPECT_THAT(RotationsError("c.jpg 1 0 nan 0"), HasSubstr("found \"nan\""));
  EXPECT_THAT(RotationsError("c.jpg 1 0 inf 0"), HasSubstr("found \"inf\""));
  EXPECT_THAT(RotationsError("c.jpg 1 0 0"), HasSubstr("found \"c.jpg\""));
  EXPECT_THAT(RotationsError("1 0 0 0"), HasSubstr("found no name"));
  EXPECT_THAT(RotationsError("0 0 0"), HasSubstr("found the end of the line"));
  EXPECT_THAT(RotationsError("# nothing\n"), HasSubstr("r.txt: found no line"));
}

TEST(RotationsFile, GivesAFrameWithoutARotationOneAndNoPlace) {
  Model model = TinyModel();
  model.images[2].cam_from_world = {{0, 0, 0, 0}, {0, 0, 0}};
  UseTrivialRigs(&model);
  ReplaceRotations({"r.txt", Line("c.jpg", kTurn)}, &model);
  const ImageGeometry image = ImageGeometries(model)[2];
  EXPECT_FALSE(image.has_pose);
  EXPECT_LT((image.cam_from_world.rotation - kTurn.toRotationMatrix()).norm(),
            1e-15);
  EXPECT_FALSE(image.cam_from_world.translation.allFinite());
}

TEST(RotationsFile, ThatContradictsItselfWithinAFrameIsRefused) {
  const Eigen::Quaterniond off(
      kTurn * Eigen::AngleAxisd(1e-4, Eigen::Vector3d::UnitX()));
  EXPECT_THAT(RotationsError(Line("c.jpg", kTurn) + Line("empty.png", off),
                             TinyRigModel()),
              HasSubstr("r.txt:2: found a rotation 0.000100 rad off the one "
                        "that line 1 gives to the same frame"));
  Model model = TinyRigModel();
  const ReplacedRotations replaced = ReplaceRotations(
      {"r.txt", Line("c.jpg", kTurn) + Line("empty.png", kTurn)}, &model);
  EXPECT_EQ(replaced.num_frames, 1);
}

TEST(RotationsFile, OfANameThatTwoImagesBearIsRefused) {
  Model model = TinyModel();
  model.images[1].name = "c.jpg";
  EXPECT_THAT(RotationsError("c.jpg 1 0 0 0", model),
              HasSubstr("which several images of the model bear"));
}

}  // namespace
}  // namespace krot::internal
