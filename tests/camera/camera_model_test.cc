#include "krot/camera/camera_model.h"

#include <algorithm>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/camera/models.h"

namespace krot::internal {
namespace {

TEST(CameraModels, AreEighteenInTheOrderOfTheirIds) {
  ASSERT_EQ(CameraModels().size(), 18u);
  for (int id = 0; id < 18; ++id) EXPECT_EQ(CameraModels()[id].id, id);
}

TEST(CameraModels, HaveAsManyParametersAsNames) {
  for (const CameraModelInfo& info : CameraModels()) {
    const auto commas =
        std::count(info.param_names.begin(), info.param_names.end(), ',');
    EXPECT_EQ(info.num_params, commas + 1) << info.name;
  }
}

TEST(CameraModels, AreFoundByIdAndByName) {
  for (const CameraModelInfo& info : CameraModels()) {
    EXPECT_EQ(FindCameraModel(info.id), &info);
    EXPECT_EQ(FindCameraModel(info.name), &info);
  }
}

TEST(CameraModels, UnknownOnesAreNotFound) {
  EXPECT_EQ(FindCameraModel(-1), nullptr);
  EXPECT_EQ(FindCameraModel(18), nullptr);
  EXPECT_EQ(FindCameraModel("SIMPLE_RADIAL "), nullptr);
  EXPECT_EQ(FindCameraModel(""), nullptr);
}

TEST(CameraModels, OnlyEquirectangularHasNoImagePlane) {
  for (const CameraModelInfo& info : CameraModels()) {
    EXPECT_EQ(info.has_image_plane, info.name != "EQUIRECTANGULAR");
  }
}

TEST(CameraModels, WithoutImagePlaneAreRefusedByNameOfTheArgument) {
  const double params[] = {2000, 1000};
  try {
    ProjectRay({Equirectangular::kId, params}, {0, 0});
    FAIL() << "EQUIRECTANGULAR was projected";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::StartsWith("model_id = 17, must be"));
  }
  EXPECT_THROW(ProjectionJacobian({18, params}, {0, 0}), std::invalid_argument);
  EXPECT_THROW(UndistortPixel({-1, params}, {0, 0}), std::invalid_argument);
}

TEST(VisitCameraModel, CallsTheVisitorWithTheModelOfTheId) {
  for (int id = 0; id <= Eucm::kId; ++id) {
    const int visited =
        VisitCameraModel(id, [](auto model) { return decltype(model)::kId; });
    EXPECT_EQ(visited, id);
  }
}

}  // namespace
}  // namespace krot::internal
