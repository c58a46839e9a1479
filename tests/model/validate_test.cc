#include "krot/model.h"

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/base/numbers.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"
#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

using ::testing::HasSubstr;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// What ValidateModel says after this change to a valid model with rigs.
std::string ErrorAfter(const std::function<void(Model*)>& change) {
  Model model = TinyRigModel();
  change(&model);
  return ModelErrorOf([&] { ValidateModel(model); });
}

TEST(ValidateModel, WantsFramesInLegacyModelsToo) {
  Model model = TinyModel();
  model.frames.pop_back();
  EXPECT_THAT(ModelErrorOf([&] { ValidateModel(model); }),
              HasSubstr("found in no frame"));
}

TEST(ValidateModel, AcceptsTinyModels) {
  EXPECT_NO_THROW(ValidateModel(TinyModel()));
  EXPECT_NO_THROW(ValidateModel(TinyRigModel()));
  EXPECT_NO_THROW(ValidateModel(Model()));
}

TEST(ValidateModel, RefusesDuplicateIds) {
  EXPECT_EQ(ErrorAfter([](Model* m) { m->cameras[1].id = 7; }),
            "cameras: found id 7 twice, expected unique ids");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->rigs[1].id = 5; }),
            "rigs: found id 5 twice, expected unique ids");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->frames[1].id = 11; }),
            "frames: found id 11 twice, expected unique ids");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->images[1].id = 9; }),
            "images: found id 9 twice, expected unique ids");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->points3D[1].id = 12; }),
            "points3D: found id 12 twice, expected unique ids");
}

TEST(ValidateModel, RefusesUnknownCameraModelsAndWrongParameterCounts) {
  EXPECT_EQ(ErrorAfter([](Model* m) { m->cameras[0].model_id = 18; }),
            "camera 7: found camera model id 18, expected 0 to 17");
  EXPECT_THAT(ErrorAfter([](Model* m) { m->cameras[0].params.pop_back(); }),
              HasSubstr("camera 7: found 3 parameters, expected 4 for "
                        "SIMPLE_RADIAL"));
}

TEST(ValidateModel, AcceptsEveryKnownCameraModel) {
  EXPECT_EQ(ErrorAfter([](Model* m) {
              m->cameras[1].model_id = 17;  // EQUIRECTANGULAR
              m->cameras[1].params = {4000, 2000};
            }),
            "");
}

TEST(ValidateModel, RefusesReferencesToRecordsThatDoNotExist) {
  EXPECT_EQ(ErrorAfter([](Model* m) { m->images[2].camera_id = 8; }),
            "image 9 (\"c.jpg\"): found camera id 8, expected one that exists "
            "in cameras");
  EXPECT_EQ(
      ErrorAfter([](Model* m) { m->rigs[0].sensors[1].sensor_id.id = 8; }),
      "rig 5: found camera 8 as a sensor, expected one that exists in "
      "cameras");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->frames[0].rig_id = 6; }),
            "frame 11: found rig id 6, expected one that exists in rigs");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->frames[0].data[1].data_id = 8; }),
            "frame 11: found image id 8, expected one that exists in images; "
            "take it out of frames, or remove both rigs and frames: then the "
            "poses in images count");
  EXPECT_EQ(ErrorAfter([](Model* m) {
              m->frames[0].data[1].data_id = (uint64_t{1} << 32) + 9;
            }),
            "frame 11: found image id 4294967305, expected one that exists in "
            "images; take it out of frames, or remove both rigs and frames: "
            "then the poses in images count");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->track_elements[0].image_id = 8; }),
            "3D point 5000000000: found image id 8 in its track, expected one "
            "that exists in images; --Model.on_contradiction follow_images "
            "reads the rest");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->track_elements[0].point2D_idx = 2; }),
            "3D point 5000000000: found 2D point 2 of image 9 (\"c.jpg\") in "
            "its track, but that image has only 2 2D points; "
            "--Model.on_contradiction follow_images reads the rest");
}

TEST(ValidateModel, RefusesTracksThatAreNotConsecutive) {
  EXPECT_EQ(ErrorAfter([](Model* m) { m->points3D[2].track_begin = 1; }),
            "3D point 12: found the track [1, 5), expected one that begins at "
            "2");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->points3D[1].track_end = 1; }),
            "3D point 1: found the track [2, 1), expected one that begins at "
            "2");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->track_elements.pop_back(); }),
            "found 4 track elements, expected the tracks' total of 5");
}

TEST(ValidateModel, RefusesIdsThatStandForNoneInColmap) {
  constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
  const std::string cure =
      ": found id 4294967295, which in COLMAP stands for none, expected "
      "another; renumber it";
  EXPECT_EQ(ErrorAfter([](Model* m) { m->cameras[1].id = kNone; }),
            "cameras" + cure);
  EXPECT_EQ(ErrorAfter([](Model* m) { m->images[1].id = kNone; }),
            "images" + cure);
  EXPECT_EQ(ErrorAfter([](Model* m) { m->rigs[1].id = kNone; }), "rigs" + cure);
  EXPECT_EQ(ErrorAfter([](Model* m) { m->frames[1].id = kNone; }),
            "frames" + cure);
  EXPECT_THAT(
      ErrorAfter([](Model* m) { m->points3D[1].id = kInvalidPoint3DId; }),
      HasSubstr("points3D: found id 18446744073709551615, which"));
}

TEST(ValidateModel, RefusesFocalLengthsOfZeroOfCamerasWithImages) {
  EXPECT_EQ(ErrorAfter([](Model* m) { m->cameras[0].params[0] = -0.0; }),
            "camera 7: found 0 for f of SIMPLE_RADIAL, expected what its "
            "photos have, in pixels");
  EXPECT_EQ(ErrorAfter([](Model* m) {
              m->cameras[0].model_id = 1;
              m->cameras[0].params = {500, 0, 320, 240};
            }),
            "camera 7: found 0 for fx, fy of PINHOLE, expected what its photos "
            "have, in pixels");
  EXPECT_EQ(ErrorAfter([](Model* m) {
              m->cameras[0].model_id = 17;
              m->cameras[0].params = {4000, 0};
            }),
            "camera 7: found 0 for w, h of EQUIRECTANGULAR, expected what its "
            "photos have, in pixels");
  // Principal points may be anywhere; so may all of a camera without images.
  EXPECT_EQ(ErrorAfter([](Model* m) {
              m->cameras[0].params[1] = 0;
              m->cameras[1].params[0] = 0;
            }),
            "");
}

TEST(ValidateModel, RefusesNamesWithAZeroByte) {
  EXPECT_EQ(ErrorAfter([](Model* m) { m->images[2].name[1] = '\0'; }),
            "image 9: found a zero byte in its name, expected none");
}

TEST(ValidateModel, RefusesSensorsThatARigCannotHave) {
  EXPECT_EQ(
      ErrorAfter([](Model* m) { m->rigs[0].sensors[1].sensor_id.id = 7; }),
      "rig 5: found the sensor CAMERA 7 twice, expected different sensors");
  EXPECT_THAT(
      ErrorAfter([](Model* m) { m->rigs[0].sensors[1].sensor_id.type = 9; }),
      HasSubstr("rig 5: found the sensor type 9 3, expected type -1"));
  EXPECT_EQ(ErrorAfter([](Model* m) { m->rigs[0].ref_sensor_id.reset(); }),
            "rig 5: found 2 sensors and no reference sensor, expected one");
}

TEST(ValidateModel, RefusesFramesThatDoNotFitTheirImagesAndRigs) {
  EXPECT_EQ(ErrorAfter([](Model* m) { m->frames[0].data[1].sensor_id.id = 3; }),
            "frame 11: found image 9 (\"c.jpg\") as data of camera 3, expected "
            "its camera 7");
  EXPECT_EQ(ErrorAfter([](Model* m) {
              m->frames[0].data[1].sensor_id.type = kSensorTypeInvalid;
            }),
            "frame 11: found data of the sensor INVALID 7, expected a camera "
            "or an IMU");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->frames[0].rig_id = 1; }),
            "image 9 (\"c.jpg\"): found its frame in rig 1, expected a rig "
            "with its camera 7");
  EXPECT_EQ(
      ErrorAfter([](Model* m) { m->rigs[0].sensors[0].sensor_from_rig = {}; }),
      "image 9 (\"c.jpg\"): found its camera 7 without a pose in rig 5, "
      "expected one; calibrate the rig, or remove both rigs and frames: then "
      "the poses in images count");
  EXPECT_EQ(ErrorAfter([](Model* m) { m->frames[1].data[0].data_id = 9; }),
            "image 9 (\"c.jpg\"): found in frame 11 and again in frame 10, "
            "expected once");
  EXPECT_EQ(ErrorAfter([](Model* m) {
              m->frames.pop_back(), m->frames[1].data.clear();
            }),
            "image 4000000000 (\"left/a b.jpg\"): found in no frame, expected "
            "one: the model has rigs and frames");
}

TEST(ValidateModel, RefusesNumbersThatAreNotFinite) {
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    EXPECT_THAT(ErrorAfter([&](Model* m) { m->cameras[1].params[3] = bad; }),
                HasSubstr("camera 3: found the parameter"));
    EXPECT_THAT(ErrorAfter([&](Model* m) { m->points3D[2].xyz[1] = bad; }),
                HasSubstr("3D point 12: found a coordinate"));
    for (double Point2D::*coordinate : {&Point2D::x, &Point2D::y}) {
      EXPECT_THAT(
          ErrorAfter(
              [&](Model* m) { m->images[2].points2D[1].*coordinate = bad; }),
          HasSubstr("found 2D point 1 of image 9 (\"c.jpg\") in its track, a "
                    "coordinate of which is "));
      // In no track.
      EXPECT_EQ(ErrorAfter([&](Model* m) {
                  m->images[0].points2D[1].*coordinate = bad;
                }),
                "");
    }
    EXPECT_THAT(ErrorAfter([&](Model* m) {
                  m->rigs[0].sensors[0].sensor_from_rig->translation[0] = bad;
                }),
                HasSubstr("rig 5: found a sensor's translation"));
  }
}

TEST(ValidateModel, AcceptsAbsentPosesAndAnyStoredError) {
  EXPECT_EQ(ErrorAfter([](Model* m) {
              m->images[2].cam_from_world.quaternion_wxyz = {0, 0, 0, 0};
              m->images[1].cam_from_world.quaternion_wxyz[2] = kNaN;
              m->frames[0].rig_from_world.quaternion_wxyz = {0, 0, 0, 0};
              m->frames[2].rig_from_world.quaternion_wxyz[0] = kInfinity;
              m->images[0].cam_from_world.translation.setConstant(kNaN);
              m->frames[0].rig_from_world.translation.setConstant(kInfinity);
              m->points3D[0].error = kNaN;
            }),
            "");
}

TEST(ValidateModel, RefusesSensorsWhoseRotationCannotBeNormalised) {
  for (const double bad : {0.0, 1e-200, 1e200, kNaN, kInfinity}) {
    EXPECT_THAT(ErrorAfter([&](Model* m) {
                  m->rigs[0].sensors[0].sensor_from_rig->quaternion_wxyz = {
                      0, 0, bad, 0};
                }),
                HasSubstr("rig 5: found the quaternion 0 0 "));
  }
}

struct Record {
  uint64_t id;
};

// Consecutive ids are looked up in a table, sparse ones in a sorted list.
const std::vector<Record> kDense = {{3}, {0}, {7}};
const std::vector<Record> kSparse = {
    {std::numeric_limits<uint64_t>::max()}, {5}, {1000000007}};

TEST(IdIndex, FindsWhatIsThereAndNothingElse) {
  for (const auto& records : {kDense, kSparse}) {
    const IdIndex<uint64_t> index(records);
    for (size_t i = 0; i < records.size(); ++i) {
      EXPECT_EQ(index.Find(records[i].id), static_cast<int32_t>(i));
    }
    for (const uint64_t id :
         {uint64_t{1}, uint64_t{6}, uint64_t{8}, uint64_t{1} << 63}) {
      EXPECT_EQ(index.Find(id), std::nullopt);
    }
    EXPECT_EQ(index.duplicate(), std::nullopt);
  }
}

TEST(IdIndex, NamesADuplicateAndFindsTheFirst) {
  for (std::vector<Record> records : {kDense, kSparse}) {
    const uint64_t id = records[1].id;
    records.push_back({id});
    const IdIndex<uint64_t> index(records);
    EXPECT_EQ(index.duplicate(), id);
    EXPECT_EQ(index.Find(id), 1);
  }
}

TEST(IdIndex, OfNothingFindsNothing) {
  EXPECT_EQ(IdIndex<uint64_t>(std::vector<Record>()).Find(0), std::nullopt);
}

// Two images; point 10 has observations 0 of both, and 0 of the first twice;
// point 11 has observations 1 of both.
Model MakeModel() {
  Model model;
  model.cameras.push_back({1, 0, 100, 100, {100, 50, 50}});
  for (const ImageId id : {1u, 2u}) {
    Image image;
    image.id = id;
    image.camera_id = 1;
    image.name = std::to_string(id);
    image.points2D = {{10, 10, 10}, {20, 20, 11}};
    model.images.push_back(image);
  }
  model.track_elements = {{1, 0}, {2, 0}, {1, 0}, {1, 1}, {2, 1}};
  Point3D point;
  point.id = 10;
  point.track_end = 3;
  model.points3D.push_back(point);
  point.id = 11;
  point.track_begin = 3;
  point.track_end = 5;
  model.points3D.push_back(point);
  UseTrivialRigs(&model);
  return model;
}

TEST(RemoveObservations, TakesATrackOfOneWithIt) {
  const RemovedObservations removed =
      RemoveObservations(MakeModel(), {0, 0, 0, 1, 0});
  ValidateModel(removed.model);
  ASSERT_EQ(removed.model.points3D.size(), 1u);
  EXPECT_EQ(removed.num_points, 1);
  EXPECT_EQ(removed.num_left_alone, 1);
  EXPECT_THAT(removed.element_of, testing::ElementsAre(0, 1, 2));
  for (const Image& image : removed.model.images) {
    EXPECT_EQ(image.points2D[1].point3D_id, kInvalidPoint3DId);
    EXPECT_EQ(image.points2D[0].point3D_id, 10u);
  }
}

TEST(RemoveObservations, KeepsA2DPointThatTheTrackHoldsASecondTime) {
  const RemovedObservations removed =
      RemoveObservations(MakeModel(), {1, 0, 0, 0, 0});
  ValidateModel(removed.model);
  EXPECT_EQ(removed.model.images[0].points2D[0].point3D_id, 10u);
  EXPECT_THAT(removed.element_of, testing::ElementsAre(1, 2, 3, 4));
}

TEST(RemoveObservations, OfNothingIsTheModel) {
  const RemovedObservations removed =
      RemoveObservations(MakeModel(), {0, 0, 0, 0, 0});
  EXPECT_EQ(removed.model.track_elements.size(), 5u);
  EXPECT_EQ(removed.num_points, 0);
  EXPECT_THROW(RemoveObservations(MakeModel(), {0}), std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
