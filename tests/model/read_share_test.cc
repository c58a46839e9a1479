// A share that is read alone is the one that is taken of the whole model.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/temp_folder.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

void WriteBinary(const Model& model, const fs::path& folder) {
  WriteModelOptions options;
  options.overwrite = true;
  WriteModel(model, folder, options);
}

bool HaveAllShares(const fs::path& folder, int count) {
  bool have_all = true;
  for (int rank = 0; rank < count; ++rank) {
    have_all &= ReadShare(folder, count, rank).has_value();
  }
  return have_all;
}

class ReadShareTest : public ::testing::Test {
 protected:
  void ExpectSharesOf(const fs::path& folder) const {
    const Model whole = ReadModel(folder);
    for (const int count : {1, 2, 3, 7}) {
      for (int rank = 0; rank < count; ++rank) {
        SCOPED_TRACE(std::to_string(rank) + " of " + std::to_string(count));
        const std::optional<ModelShare> share = ReadShare(folder, count, rank);
        ASSERT_TRUE(share.has_value());
        const ModelShare taken =
            TakeShare(whole, CutPoints(whole, count)[rank]);
        EXPECT_THAT(share->model, IsModel(taken.model));
        EXPECT_EQ(share->point2D_of, taken.point2D_of);
      }
    }
  }
  // Some share is refused of the tiny model once it is changed, however many
  // there are.
  void ExpectNeedsWhole(const std::function<void(Model*)>& change) const {
    Model model = TinyModel();
    WriteBinary(model, folder_ / "model");
    ASSERT_TRUE(HaveAllShares(folder_ / "model", 3));
    change(&model);
    WriteBinary(model, folder_ / "model");
    for (const int count : {1, 2, 3, 5}) {
      EXPECT_FALSE(HaveAllShares(folder_ / "model", count)) << count;
    }
  }
  // The same once a file is changed.
  void ExpectNeedsWholeOf(const std::string& name,
                          const std::function<void(std::string*)>& change) {
    WriteBinary(TinyRigModel(), folder_ / "model");
    ASSERT_TRUE(HaveAllShares(folder_ / "model", 2));
    std::string bytes = ReadBytes(folder_ / "model" / name);
    change(&bytes);
    WriteBytes(folder_ / "model" / name, bytes);
    EXPECT_FALSE(HaveAllShares(folder_ / "model", 2)) << name;
  }

  TempFolder folder_;
};

TEST_F(ReadShareTest, IsThatOfTheWholeModel) {
  WriteBinary(TinyModel(), folder_ / "model");
  ExpectSharesOf(folder_ / "model");
}

TEST_F(ReadShareTest, IsThatOfAModelWithRigs) {
  WriteBinary(TinyRigModel(), folder_ / "model");
  ExpectSharesOf(folder_ / "model");
}

TEST_F(ReadShareTest, IsThatOfRealModels) {
  if (!RealModels()) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  for (const char* name : {"south128", "task41_rigs_frames", "longtracks92"}) {
    SCOPED_TRACE(name);
    ExpectSharesOf(*RealModels() / name);
  }
}

TEST_F(ReadShareTest, NeedsTheWholeOfText) {
  WriteModelOptions options;
  options.format = ModelFormat::kText;
  WriteModel(TinyModel(), folder_ / "text", options);
  EXPECT_FALSE(ReadShare(folder_ / "text", 2, 0).has_value());
  EXPECT_FALSE(ReadShare(folder_ / "none", 2, 0).has_value());
}

TEST_F(ReadShareTest, NeedsTheWholeOfWhatContradictsItself) {
  ExpectNeedsWhole([](Model* m) { m->track_elements[0].point2D_idx = 1; });
  ExpectNeedsWhole([](Model* m) { m->track_elements[0].point2D_idx = 2; });
  ExpectNeedsWhole([](Model* m) { m->track_elements[1].image_id = 5; });
  ExpectNeedsWhole([](Model* m) { m->track_elements[4].point2D_idx = 0; });
  for (const Point3DId id : {0, 1, 2, 12, 13}) {  // 1 and 12 exist
    ExpectNeedsWhole(
        [id](Model* m) { m->images[0].points2D[1].point3D_id = id; });
  }
  ExpectNeedsWhole(
      [](Model* m) { m->images[0].points2D[1].point3D_id = 6000000000; });
}

TEST_F(ReadShareTest, NeedsTheWholeOfWhatIsNotValid) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  ExpectNeedsWhole([](Model* m) { m->images[0].points2D[0].x = kNan; });
  ExpectNeedsWhole([](Model* m) { m->images[0].points2D[1].y = kNan; });
  ExpectNeedsWhole([](Model* m) { m->points3D[2].xyz[1] = kNan; });
  ExpectNeedsWhole([](Model* m) { m->points3D[1].id = 12; });
  ExpectNeedsWhole([](Model* m) { m->images[1].camera_id = 4; });
  ExpectNeedsWhole([](Model* m) { m->images[1].id = 9; });
  ExpectNeedsWhole([](Model* m) {  // nothing to solve
    m->track_elements.clear();
    for (Point3D& point : m->points3D) point.track_begin = point.track_end = 0;
    for (Image& image : m->images) image.points2D.clear();
  });
}

TEST_F(ReadShareTest, NeedsTheWholeWhereFilesAreCutOrLonger) {
  for (const char* name : {"cameras.bin", "rigs.bin", "frames.bin",
                           "images.bin", "points3D.bin"}) {
    ExpectNeedsWholeOf(name, [](std::string* bytes) { bytes->pop_back(); });
    ExpectNeedsWholeOf(name, [](std::string* bytes) { bytes->push_back(0); });
    ExpectNeedsWholeOf(name, [](std::string* bytes) { bytes->resize(7); });
    ExpectNeedsWholeOf(name, [](std::string* bytes) { (*bytes)[6] = 1; });
  }
}

}  // namespace
}  // namespace krot::internal
