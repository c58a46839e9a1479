#include "krot/model/formats.h"

#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

using ::testing::HasSubstr;

std::string ErrorOf(void (*parse)(const FileBytes&, Model*),
                    const std::string& text) {
  Model model;
  return ModelErrorOf([&] { parse({"f.txt", text}, &model); });
}

TEST(TextIo, ReadsBackWhatItWrote) {
  const Model model = TinyRigModel();
  Model read;
  read.stores_rigs = true;
  ParseCamerasText({"cameras", FormatCamerasText(model)}, &read);
  ParseRigsText({"rigs", FormatRigsText(model)}, &read);
  ParseFramesText({"frames", FormatFramesText(model)}, &read);
  ParseImagesText({"images", FormatImagesText(model)}, &read);
  ParsePoints3DText({"points3D", FormatPoints3DText(model)}, &read);
  EXPECT_THAT(read, IsModel(model));
}

TEST(TextIo, WritesNumbersThatComeBackWithTheSameBits) {
  const double values[] = {0.1,
                           -0.0,
                           1e-310,
                           std::nextafter(1.0, 2.0),
                           std::numeric_limits<double>::max(),
                           std::numeric_limits<double>::infinity(),
                           -std::numeric_limits<double>::infinity(),
                           std::numeric_limits<double>::quiet_NaN(),
                           -std::numeric_limits<double>::quiet_NaN()};
  Model model;
  for (const double value : values) {
    Image image;
    image.cam_from_world.translation.setConstant(value);
    model.images.push_back(image);
  }
  Model read;
  ParseImagesText({"images", FormatImagesText(model)}, &read);
  EXPECT_THAT(read, IsModel(model));
}

TEST(TextIo, LaysRecordsOutAsColmapDoes) {
  const Model model = TinyRigModel();
  EXPECT_THAT(FormatCamerasText(model),
              HasSubstr("\n7 SIMPLE_RADIAL 640 480 500.1 320 240 -0.1\n"));
  EXPECT_THAT(FormatRigsText(model),
              HasSubstr("\n5 3 IMU 1 CAMERA 7 1 1 0.1 0 0 0 0.3 0 CAMERA 3 0\n"
                        "1 0\n"));
  EXPECT_THAT(FormatFramesText(model),
              HasSubstr("\n10 5 0.1 0.2 0.3 0.4 1 2 0.14285714285714285 1 "
                        "CAMERA 7 4000000000\n"));
  EXPECT_THAT(
      FormatImagesText(model),
      HasSubstr("\n4000000000 0.5 -0.5 0.5 -0.5 0.1 0.2 0.3 7 left/a b.jpg\n"
                "10.5 20.25 12 1e-07 3 -1 0.1 0.7 5000000000 11 21 12\n"));
  EXPECT_THAT(FormatPoints3DText(model),
              HasSubstr("\n5000000000 1 2 3 255 0 9 0.25 9 0 4000000000 2\n"));
}

TEST(TextIo, SkipsCommentsBlankLinesAndCarriageReturns) {
  Model model;
  ParseCamerasText({"f.txt",
                    "# a comment\r\n\r\n  \n"
                    "  1\tPINHOLE 640  480 +1 2 3e0 4 \r\n"
                    "#2 PINHOLE\n"},
                   &model);
  ASSERT_EQ(model.cameras.size(), 1);
  EXPECT_EQ(model.cameras[0].height, 480);
  EXPECT_EQ(model.cameras[0].params, (std::vector<double>{1, 2, 3, 4}));
}

TEST(TextIo, SkipsAByteOrderMarkInEveryFile) {
  const Model model = TinyRigModel();
  const std::string mark = "\xef\xbb\xbf";
  Model read;
  read.stores_rigs = true;
  ParseCamerasText({"c", mark + FormatCamerasText(model)}, &read);
  ParseRigsText({"r", mark + FormatRigsText(model)}, &read);
  ParseFramesText({"f", mark + FormatFramesText(model)}, &read);
  ParseImagesText({"i", mark + FormatImagesText(model)}, &read);
  ParsePoints3DText({"p", mark + FormatPoints3DText(model)}, &read);
  EXPECT_THAT(read, IsModel(model));
  // Without a comment in front, too.
  ParseCamerasText({"c", mark + "7 SIMPLE_PINHOLE 4 3 5 2 1.5"}, &read);
  EXPECT_EQ(read.cameras.at(0).id, 7);
}

TEST(TextIo, SaysThatUtf16IsToBecomeUtf8) {
  for (const char* mark : {"\xff\xfe", "\xfe\xff"}) {
    EXPECT_EQ(ErrorOf(ParseCamerasText, std::string(mark) + "#"),
              "f.txt: found UTF-16, expected UTF-8; save it as UTF-8 text");
  }
}

TEST(TextIo, ReadsIntegersThatAreWrittenAsRealNumbers) {
  Model model;
  ParseCamerasText({"f.txt", "7.0 PINHOLE 1000.0 7.5e+02 1 2 3 4\n"}, &model);
  EXPECT_EQ(model.cameras.at(0).id, 7);
  EXPECT_EQ(model.cameras[0].width, 1000);
  EXPECT_EQ(model.cameras[0].height, 750);
  ParseRigsText({"f.txt", "1.0 2.0 CAMERA 7.0 CAMERA 8.0 0.0\n"}, &model);
  EXPECT_EQ(model.rigs.at(0).sensors.at(0).sensor_id.id, 8);
  ParseFramesText({"f.txt", "1.0 1 1 0 0 0 0 0 0 1.0 CAMERA 7 9.0\n"}, &model);
  EXPECT_EQ(model.frames.at(0).data.at(0).data_id, 9);
  ParseImagesText({"f.txt", "9.0 1 0 0 0 0 0 0 7.0 a.jpg\n1 2 -1.0 3 4 5.0\n"},
                  &model);
  EXPECT_EQ(model.images.at(0).points2D.at(0).point3D_id, kInvalidPoint3DId);
  EXPECT_EQ(model.images[0].points2D.at(1).point3D_id, 5);
  ParsePoints3DText({"f.txt", "5.0 0 0 0 176.0 248.0 1.2e1 0.5 9.0 1.0\n"},
                    &model);
  EXPECT_EQ(model.points3D.at(0).color[0], 176);
  EXPECT_EQ(model.points3D[0].color[2], 12);
  EXPECT_EQ(model.track_elements.at(0).point2D_idx, 1);
}

TEST(TextIo, ReadsNoIntegerThatARealNumberDoesNotHoldExactly) {
  for (const char* id : {"9007199254740993.0", "18446744073709551616", "1e99",
                         "1.5", "-2.0", "nan", "inf"}) {
    EXPECT_THAT(ErrorOf(ParsePoints3DText, std::string(id) + " 0 0 0 1 1 1 1"),
                HasSubstr(std::string("found \"") + id +
                          "\", expected a 3D point id, an integer from 0 to "
                          "18446744073709551615"));
  }
}

TEST(TextIo, TakesACommentForTheEmptySecondLineOfAnImage) {
  // As COLMAP does, whose FAQ has this example.
  Model model;
  ParseImagesText({"f.txt",
                   "1 1 0 0 0 0 0 0 1 a.png\n"
                   "# Make sure every other line is left empty\n"
                   "2 1 0 0 0 0 0 0 1 b.png\n"
                   "\n"},
                  &model);
  ASSERT_EQ(model.images.size(), 2);
  EXPECT_EQ(model.images[1].name, "b.png");
  EXPECT_EQ(model.images[0].points2D.size(), 0);
}

TEST(TextIo, SaysThatAnImageHasTwoLines) {
  const std::string cure =
      "f.txt:3: found the line of another image, expected the 2D points of "
      "image 1 (\"a.jpg\"): an image has two lines, of which the second may be "
      "empty; put an empty line behind each";
  for (const char* second :
       {"2 0.25 0.3 0.7 -0.5 -0.1 0.1 5.1 1 b.jpg\n",
        // All of whose numbers could be those of 2D points.
        "2 1 0 0 0 0 0 1 1 b.jpg\n"}) {
    EXPECT_EQ(ErrorOf(ParseImagesText,
                      "# one line per image\n1 1 0 0 0 0 0 0 1 a.jpg\n" +
                          std::string(second)),
              cure);
  }
}

TEST(TextIo, SaysThatNumbersHaveNoCommas) {
  const std::string cure =
      "; write numbers with a decimal point, without commas";
  EXPECT_EQ(ErrorOf(ParseCamerasText, "1 SIMPLE_PINHOLE 4 3 800,0 2 1\n"),
            "f.txt:1: found \"800,0\", expected a number: the parameters f, "
            "cx, cy of SIMPLE_PINHOLE" +
                cure);
  EXPECT_EQ(ErrorOf(ParseCamerasText, "1, PINHOLE, 4, 3, 5, 5, 2, 1\n"),
            "f.txt:1: found \"1,\", expected a camera id" + cure);
  EXPECT_THAT(ErrorOf(ParseImagesText, "1 1 0 0 0 0 0 0 1 a\n576,10 311,4 1\n"),
              HasSubstr(cure));
}

TEST(TextIo, TakesTheLineAfterAnImageForItsPointsEvenIfEmpty) {
  Model model;
  ParseImagesText({"f.txt",
                   "1 1 0 0 0 0 0 0 1 empty.jpg\n"
                   "\n"
                   "2 1 0 0 0 0 0 0 1 two points.jpg\r\n"
                   " 1 2 -1 3 4 5\r\n"
                   "\n"
                   "3 1 0 0 0 0 0 0 1 last.jpg"},
                  &model);
  ASSERT_EQ(model.images.size(), 3);
  EXPECT_EQ(model.images[0].points2D.size(), 0);
  EXPECT_EQ(model.images[1].name, "two points.jpg");
  ASSERT_EQ(model.images[1].points2D.size(), 2);
  EXPECT_EQ(model.images[1].points2D[0].point3D_id, kInvalidPoint3DId);
  EXPECT_EQ(model.images[1].points2D[1].point3D_id, 5);
  EXPECT_EQ(model.images[2].name, "last.jpg");
}

TEST(TextIo, SaysWhichWordOfWhichLineIsNoNumber) {
  EXPECT_EQ(ErrorOf(ParseCamerasText, "# head\n1 PINHOLE 640 abc 1 2 3 4\n"),
            "f.txt:2: found \"abc\", expected the height of a camera");
  EXPECT_EQ(ErrorOf(ParsePoints3DText, "1 0 0 0.1.2 0 0 0 1\n"),
            "f.txt:1: found \"0.1.2\", expected a number: X, Y, Z of a 3D "
            "point");
  EXPECT_EQ(ErrorOf(ParsePoints3DText, "1 0 0 0 0 256 0 1\n"),
            "f.txt:1: found \"256\", expected R, G, B of a 3D point, an "
            "integer from 0 to 255");
  EXPECT_EQ(ErrorOf(ParsePoints3DText, "1 0 0 0 0 0 0 1 5 -1\n"),
            "f.txt:1: found \"-1\", expected the POINT2D_IDX of a track, an "
            "integer from 0 to 4294967295");
  EXPECT_EQ(ErrorOf(ParseImagesText, "1 1 0 0 0 0 0 0 1 a.jpg\n1 2 -2\n"),
            "f.txt:2: found \"-2\", expected the POINT3D_ID of a 2D point, or "
            "-1");
  EXPECT_EQ(ErrorOf(ParseImagesText, "1 1 0 0 0 0 0 1e999 1 a.jpg\n\n"),
            "f.txt:1: found \"1e999\", expected a number: TX, TY, TZ of a "
            "pose");
}

TEST(TextIo, RefusesLinesThatEndEarly) {
  EXPECT_EQ(ErrorOf(ParseCamerasText, "1 PINHOLE 640 480 1 2 3\n"),
            "f.txt:1: found the end of the line, expected a number: the "
            "parameters fx, fy, cx, cy of PINHOLE");
  EXPECT_THAT(ErrorOf(ParseImagesText, "1 1 0 0 0\n"),
              HasSubstr("found the end of the line"));
  EXPECT_THAT(ErrorOf(ParseImagesText, "1 1 0 0 0 0 0 0 1 a.jpg\n1 2\n"),
              HasSubstr("f.txt:2: found the end of the line"));
  EXPECT_THAT(ErrorOf(ParsePoints3DText, "1 0 0 0 0 0 0 1 5\n"),
              HasSubstr("expected the POINT2D_IDX of a track"));
  EXPECT_THAT(ErrorOf(ParseRigsText, "1 4000000000 CAMERA 1\n"),
              HasSubstr("expected a sensor type"));
  EXPECT_THAT(ErrorOf(ParseFramesText, "1 1 1 0 0 0 0 0 0 2 CAMERA 1 1\n"),
              HasSubstr("expected a sensor type"));
}

TEST(TextIo, RefusesWordsAfterTheEndOfARecord) {
  EXPECT_EQ(ErrorOf(ParseCamerasText, "1 PINHOLE 640 480 1 2 3 4 5\n"),
            "f.txt:1: found \"5\", expected the end of the line after the "
            "parameters of a camera");
  EXPECT_THAT(ErrorOf(ParseRigsText, "1 1 CAMERA 1 CAMERA 2 0\n"),
              HasSubstr("after the sensors of a rig"));
  EXPECT_THAT(ErrorOf(ParseFramesText, "1 1 1 0 0 0 0 0 0 0 CAMERA 1 1\n"),
              HasSubstr("after the data ids of a frame"));
}

TEST(TextIo, RefusesNamesThatItDoesNotKnow) {
  EXPECT_EQ(ErrorOf(ParseCamerasText, "1 PINHOLY 640 480 1 2 3 4\n"),
            "f.txt:1: found \"PINHOLY\", expected the name of a camera model, "
            "such as PINHOLE");
  EXPECT_EQ(ErrorOf(ParseRigsText, "1 1 LIDAR 1\n"),
            "f.txt:1: found \"LIDAR\", expected a sensor type: CAMERA, IMU or "
            "INVALID");
  EXPECT_THAT(ErrorOf(ParseRigsText, "1 2 CAMERA 1 CAMERA 2 yes\n"),
              HasSubstr("found \"yes\", expected 0 or 1"));
}

TEST(TextIo, SurvivesACutAtAnyCharacter) {
  const Model model = TinyRigModel();
  const std::string texts[] = {FormatCamerasText(model), FormatRigsText(model),
                               FormatFramesText(model), FormatImagesText(model),
                               FormatPoints3DText(model)};
  void (*const parsers[])(const FileBytes&, Model*) = {
      ParseCamerasText, ParseRigsText, ParseFramesText, ParseImagesText,
      ParsePoints3DText};
  for (int i = 0; i < 5; ++i) {
    for (size_t size = 0; size < texts[i].size(); ++size) {
      EXPECT_NO_THROW(ErrorOf(parsers[i], texts[i].substr(0, size)));
    }
  }
}

TEST(TextIo, RefusesToWriteWhatItCouldNotReadBack) {
  for (const char* name : {" a.jpg", "a.jpg ", "a\nb.jpg", "a\rb.jpg"}) {
    Model model = TinyModel();
    model.images[2].name = name;
    EXPECT_THAT(WriteErrorOf([&] { FormatImagesText(model); }),
                HasSubstr("image 9: found the name"))
        << name;
  }
  Model model = TinyRigModel();
  model.rigs[0].sensors[1].sensor_id.type = 5;
  EXPECT_THAT(WriteErrorOf([&] { FormatRigsText(model); }),
              HasSubstr("found sensor type 5"));
  model.cameras[0].model_id = 99;
  EXPECT_THAT(WriteErrorOf([&] { FormatCamerasText(model); }),
              HasSubstr("camera 7: found camera model id 99"));
}

}  // namespace
}  // namespace krot::internal
