#include "krot/model/formats.h"

#include <cstring>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

struct Part {
  const char* name;
  void (*parse)(const FileBytes& file, Model* model);
  std::string (*format)(const Model& model);
};
const Part kParts[] = {{"cameras", ParseCamerasBinary, FormatCamerasBinary},
                       {"rigs", ParseRigsBinary, FormatRigsBinary},
                       {"frames", ParseFramesBinary, FormatFramesBinary},
                       {"images", ParseImagesBinary, FormatImagesBinary},
                       {"points3D", ParsePoints3DBinary, FormatPoints3DBinary}};

template <typename T>
std::string Bytes(T value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

template <typename T>
std::string With(std::string bytes, size_t offset, T value) {
  return bytes.replace(offset, sizeof(T), Bytes(value));
}

std::string BinaryError(void (*parse)(const FileBytes&, Model*),
                        const std::string& bytes) {
  Model model;
  return ModelErrorOf([&] { parse({"f.bin", bytes}, &model); });
}

TEST(BinaryIo, LaysACameraOutAsColmapDoes) {
  Model model;
  model.cameras = {{7, 0, 640, 480, {500, 320, 240}}};
  EXPECT_EQ(FormatCamerasBinary(model),
            Bytes<uint64_t>(1) + Bytes<uint32_t>(7) + Bytes<int32_t>(0) +
                Bytes<uint64_t>(640) + Bytes<uint64_t>(480) +
                Bytes<double>(500) + Bytes<double>(320) + Bytes<double>(240));
}

TEST(BinaryIo, LaysAnImageOutAsColmapDoes) {
  Model model;
  Image image;
  image.id = 3;
  image.cam_from_world = {{1, 2, 3, 4}, {5, 6, 7}};
  image.camera_id = 9;
  image.name = "a.jpg";
  image.points2D = {{1.5, 2.5, kInvalidPoint3DId}};
  model.images = {image};
  std::string expected = Bytes<uint64_t>(1) + Bytes<uint32_t>(3);
  for (int i = 1; i <= 7; ++i) expected += Bytes<double>(i);
  expected += Bytes<uint32_t>(9) + std::string("a.jpg\0", 6) +
              Bytes<uint64_t>(1) + Bytes<double>(1.5) + Bytes<double>(2.5) +
              std::string(8, '\xff');
  EXPECT_EQ(FormatImagesBinary(model), expected);
}

TEST(BinaryIo, LaysAPointOutAsColmapDoes) {
  Model model;
  model.points3D = {{6, {1, 2, 3}, {10, 20, 30}, 0.5, 0, 1}};
  model.track_elements = {{3, 0}};
  EXPECT_EQ(FormatPoints3DBinary(model),
            Bytes<uint64_t>(1) + Bytes<uint64_t>(6) + Bytes<double>(1) +
                Bytes<double>(2) + Bytes<double>(3) + "\x0a\x14\x1e" +
                Bytes<double>(0.5) + Bytes<uint64_t>(1) + Bytes<uint32_t>(3) +
                Bytes<uint32_t>(0));
}

TEST(BinaryIo, LaysARigOutAsColmapDoes) {
  Model model;
  Rig rig;
  rig.id = 2;
  rig.ref_sensor_id = SensorId{kSensorTypeCamera, 4};
  rig.sensors = {{{kSensorTypeImu, 5}, std::nullopt}};
  model.rigs = {rig};
  EXPECT_EQ(FormatRigsBinary(model),
            Bytes<uint64_t>(1) + Bytes<uint32_t>(2) + Bytes<uint32_t>(2) +
                Bytes<int32_t>(0) + Bytes<uint32_t>(4) + Bytes<int32_t>(1) +
                Bytes<uint32_t>(5) + Bytes<uint8_t>(0));
}

TEST(BinaryIo, LaysAFrameOutAsColmapDoes) {
  Model model;
  Frame frame;
  frame.id = 2;
  frame.rig_id = 8;
  frame.rig_from_world = {{1, 2, 3, 4}, {5, 6, 7}};
  frame.data = {{{kSensorTypeCamera, 4}, 6}};
  model.frames = {frame};
  std::string expected =
      Bytes<uint64_t>(1) + Bytes<uint32_t>(2) + Bytes<uint32_t>(8);
  for (int i = 1; i <= 7; ++i) expected += Bytes<double>(i);
  expected += Bytes<uint32_t>(1) + Bytes<int32_t>(0) + Bytes<uint32_t>(4) +
              Bytes<uint64_t>(6);
  EXPECT_EQ(FormatFramesBinary(model), expected);
}

TEST(BinaryIo, ReadsBackWhatItWrote) {
  const Model model = TinyRigModel();
  Model read;
  read.stores_rigs = true;
  for (const Part& part : kParts) {
    part.parse({part.name, part.format(model)}, &read);
  }
  EXPECT_THAT(read, IsModel(model));
}

TEST(BinaryIo, RefusesAFileCutAtAnyByte) {
  const Model model = TinyRigModel();
  for (const Part& part : kParts) {
    const std::string bytes = part.format(model);
    for (size_t size = 0; size < bytes.size(); ++size) {
      EXPECT_THAT(BinaryError(part.parse, bytes.substr(0, size)),
                  AllOf(StartsWith("f.bin, byte "), HasSubstr("expected")))
          << part.name << " cut at " << size;
    }
  }
}

// A wrong value anywhere must be read as some value or be refused; above all
// no count may be believed before it is checked.
TEST(BinaryIo, SurvivesHugeValuesAtAnyByte) {
  const Model model = TinyRigModel();
  for (const Part& part : kParts) {
    const std::string bytes = part.format(model);
    for (size_t offset = 0; offset + 8 <= bytes.size(); ++offset) {
      for (const uint64_t value :
           {~uint64_t{0}, uint64_t{1} << 62, uint64_t{1} << 40,
            uint64_t{0x7fffffff}, uint64_t{0}}) {
        EXPECT_NO_THROW(BinaryError(part.parse, With(bytes, offset, value)))
            << part.name << ", " << value << " at " << offset;
      }
    }
  }
}

TEST(BinaryIo, ChecksEveryCountAgainstTheFile) {
  const Model model = TinyRigModel();
  for (const Part& part : kParts) {
    const std::string bytes = part.format(model);
    for (const uint64_t count : {~uint64_t{0}, uint64_t{1} << 33}) {
      EXPECT_THAT(BinaryError(part.parse, With(bytes, 0, count)),
                  AllOf(HasSubstr("byte 0: found number of"),
                        HasSubstr(std::to_string(count)),
                        HasSubstr("expected at most")))
          << part.name;
    }
  }
  const size_t num_points2D = 8 + 4 + 56 + 4 + sizeof("left/a b.jpg");
  EXPECT_THAT(
      BinaryError(ParseImagesBinary, With(FormatImagesBinary(model),
                                          num_points2D, uint64_t{1} << 60)),
      HasSubstr("found number of 2D points = 1152921504606846976"));
  EXPECT_THAT(BinaryError(ParsePoints3DBinary,
                          With(FormatPoints3DBinary(model), 8 + 8 + 24 + 3 + 8,
                               uint64_t{1000})),
              HasSubstr("found track length = 1000"));
  EXPECT_THAT(BinaryError(ParseRigsBinary,
                          With(FormatRigsBinary(model), 12, ~uint32_t{0})),
              HasSubstr("found number of sensors = 4294967295"));
  EXPECT_THAT(BinaryError(ParseFramesBinary, With(FormatFramesBinary(model),
                                                  8 + 8 + 56, ~uint32_t{0})),
              HasSubstr("found number of data ids = 4294967295"));
}

TEST(BinaryIo, RefusesBytesAfterTheLastRecord) {
  const Model model = TinyRigModel();
  for (const Part& part : kParts) {
    EXPECT_THAT(BinaryError(part.parse, part.format(model) + "xyz"),
                HasSubstr("found 3 more bytes after the last record, expected "
                          "the end of the file"))
        << part.name;
  }
}

TEST(BinaryIo, RefusesAnUnknownCameraModel) {
  EXPECT_EQ(
      BinaryError(ParseCamerasBinary,
                  With(FormatCamerasBinary(TinyModel()), 12, int32_t{99})),
      "f.bin, byte 12: found camera model id 99 (camera 7), expected 0 "
      "to 17");
}

TEST(BinaryIo, RefusesANameWithoutEnd) {
  std::string bytes = FormatImagesBinary(TinyModel());
  bytes.resize(8 + 4 + 56 + 4);
  bytes += std::string(200, 'x');
  EXPECT_THAT(BinaryError(ParseImagesBinary, bytes),
              HasSubstr("byte 72: found no zero byte before the end of the "
                        "file, expected one that ends the name of an image"));
}

TEST(BinaryIo, RefusesAPoseFlagThatIsNoFlag) {
  const size_t flag = 8 + 4 + 4 + 8 + 8;
  EXPECT_THAT(
      BinaryError(ParseRigsBinary,
                  With(FormatRigsBinary(TinyRigModel()), flag, uint8_t{7})),
      HasSubstr("byte 32: found pose flag 7"));
}

}  // namespace
}  // namespace krot::internal
