#include "krot/database.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/testing/database_writer.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::vector<Eigen::Vector2d> kKeypoints = {{1.5, 2}, {30, 4}, {5, 60.25}};

// Images a, b and c, whose 2D points are not in the model.
Model ThreeImages() {
  Model model;
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) {
    Image image;
    image.id = static_cast<ImageId>(10 + model.images.size());
    image.name = name;
    model.images.push_back(image);
  }
  return model;
}

// Of b.jpg and a.jpg, with two matches, and of x.jpg, which is elsewhere.
void WriteImages(DatabaseWriter* writer) {
  writer->AddImage(1, "x.jpg", kKeypoints);
  writer->AddImage(2, "b.jpg", kKeypoints, 2);
  writer->AddImage(5, "a.jpg", kKeypoints, 6);
  writer->AddPair(2, 5, {{0, 1}, {2, 0}}, 3);
  writer->AddPair(1, 2, {{0, 0}});
}

std::string DatabaseError(const fs::path& path, const Model& model) {
  return ModelErrorOf([&] { ReadDatabase(path, model); });
}

TEST(Database, JoinsImagesByNameWhateverTheirIds) {
  for (const bool has_rigs : {false, true}) {
    const TempFolder folder;
    {
      DatabaseWriter writer(folder / "database.db", has_rigs);
      WriteImages(&writer);
    }
    std::string note;
    const Database database =
        ReadDatabase(folder / "database.db", ThreeImages(),
                     [&](const std::string& sentence) { note = sentence; });
    EXPECT_EQ(database.num_images, 2);
    EXPECT_THAT(note, HasSubstr("has 2 of the model's 3 images"));
    EXPECT_EQ(database.keypoints[0], kKeypoints);
    EXPECT_EQ(database.keypoints[1], kKeypoints);
    EXPECT_TRUE(database.keypoints[2].empty());
    EXPECT_EQ(database.num_other_pairs, 1);
    ASSERT_EQ(database.pairs.size(), 1);
    const VerifiedPair& pair = database.pairs[0];
    EXPECT_EQ(pair.image1, 1);
    EXPECT_EQ(pair.image2, 0);
    EXPECT_EQ(pair.config, 3);
    EXPECT_THAT(pair.matches,
                ElementsAre(ElementsAre(0u, 1u), ElementsAre(2u, 0u)));
  }
}

TEST(Database, TakesNoPairsThatColmapDoesNotUse) {
  const TempFolder folder;
  {
    DatabaseWriter writer(folder / "database.db");
    writer.AddImage(1, "a.jpg", kKeypoints);
    writer.AddImage(2, "b.jpg", kKeypoints);
    writer.AddImage(3, "c.jpg", kKeypoints);
    writer.AddPair(1, 2, {{0, 0}}, 1);  // degenerate
    writer.AddPair(1, 3, {}, 2);
    writer.AddPair(2, 3, {{0, 0}}, 7);  // a watermark
  }
  const Database database = ReadDatabase(folder / "database.db", ThreeImages());
  EXPECT_TRUE(database.pairs.empty());
  EXPECT_EQ(database.num_watermarks, 1);
}

// As other programs write them, and COLMAP reads them.
TEST(Database, TakesPairIdsWithTheLargerImageIdFirst) {
  const TempFolder folder;
  {
    DatabaseWriter writer(folder / "database.db");
    writer.AddImage(1, "a.jpg", kKeypoints);
    writer.AddImage(2, "b.jpg", kKeypoints);
    writer.AddImage(3, "c.jpg", kKeypoints);
    writer.AddPair(1, 2, {{0, 1}, {2, 2}}, 2);
    writer.AddPair(1, 3, {{0, 2}}, 2);
    writer.AddPair(2, 3, {{0, 1}}, 2);
    writer.Execute(
        "UPDATE two_view_geometries SET pair_id = 2147483647 * 2 + 1 WHERE "
        "pair_id = 2147483647 + 2");
    // Once more, with one match that is known.
    writer.AddPair(1, 2, {{1, 0}, {0, 1}}, 2);
  }
  const Database database = ReadDatabase(folder / "database.db", ThreeImages());
  ASSERT_EQ(database.pairs.size(), 3);
  EXPECT_EQ(database.pairs[0].image1, 0);
  EXPECT_EQ(database.pairs[0].image2, 1);
  EXPECT_THAT(database.pairs[0].matches,
              ElementsAre(ElementsAre(0u, 1u), ElementsAre(1u, 0u),
                          ElementsAre(2u, 2u)));
}

TEST(Database, LeavesItsFolderAsItWas) {
  const TempFolder folder;
  {
    DatabaseWriter writer(folder / "a %20?#b.db");
    WriteImages(&writer);
  }
  const std::string bytes = ReadBytes(folder / "a %20?#b.db");
  ReadDatabase(folder / "a %20?#b.db", ThreeImages());
  EXPECT_THAT(FileNames(folder.path()), ElementsAre("a %20?#b.db"));
  EXPECT_EQ(ReadBytes(folder / "a %20?#b.db"), bytes);
  // An empty log, of a program that ended badly, changes nothing.
  WriteBytes(folder / "a %20?#b.db-wal", "");
  ReadDatabase(folder / "a %20?#b.db", ThreeImages());
  EXPECT_THAT(FileNames(folder.path()),
              ElementsAre("a %20?#b.db", "a %20?#b.db-wal"));
}

TEST(Database, SeesWhatARunningProgramHasCommittedAndDoesNotBlockIt) {
  const TempFolder folder;
  DatabaseWriter writer(folder / "database.db");
  WriteImages(&writer);
  writer.Execute("BEGIN IMMEDIATE");
  writer.AddImage(6, "c.jpg", kKeypoints);
  EXPECT_EQ(ReadDatabase(folder / "database.db", ThreeImages()).num_images, 2);
  writer.Execute("COMMIT");
  EXPECT_EQ(ReadDatabase(folder / "database.db", ThreeImages()).num_images, 3);
  writer.Execute("DELETE FROM two_view_geometries");
  EXPECT_TRUE(
      ReadDatabase(folder / "database.db", ThreeImages()).pairs.empty());
}

// Its log holds what was committed last, and needs no index of SQLite's.
TEST(Database, SeesWhatAProgramThatDiedHasCommittedAndWritesNothing) {
  const TempFolder folder;
  DatabaseWriter writer(folder / "running.db");
  WriteImages(&writer);
  writer.AddImage(6, "c.jpg", kKeypoints);
  const std::string log = ReadBytes(folder / "running.db-wal");
  ASSERT_FALSE(log.empty());
  const TempFolder copy;
  WriteBytes(copy / "database.db", ReadBytes(folder / "running.db"));
  WriteBytes(copy / "database.db-wal", log);
  EXPECT_EQ(ReadDatabase(copy / "database.db", ThreeImages()).num_images, 3);
  EXPECT_THAT(FileNames(copy.path()),
              ElementsAre("database.db", "database.db-wal"));
  EXPECT_EQ(ReadBytes(copy / "database.db-wal"), log);
}

TEST(Database, TakesKeypointsFromTheModelWhosePhotosWereUndistortedSince) {
  const TempFolder folder;
  {
    DatabaseWriter writer(folder / "database.db");
    WriteImages(&writer);
    writer.AddImage(6, "c.jpg", {{10, 20}});
  }
  Model model = ThreeImages();
  model.images[0].points2D = {{2, 3, 7}, {28, 4, 7}, {5, 66, 7}};
  model.images[2].points2D = {{11, 21, 7}};  // nothing to correlate
  const Database database = ReadDatabase(folder / "database.db", model);
  EXPECT_EQ(database.keypoints[0][2], Eigen::Vector2d(5, 66));
  EXPECT_EQ(database.keypoints[1], kKeypoints);
}

TEST(Database, IsRefusedIfTheModelWasMadeFromOtherFeatures) {
  const TempFolder folder;
  {
    DatabaseWriter writer(folder / "database.db");
    WriteImages(&writer);
  }
  Model model = ThreeImages();
  model.images[0].points2D = {{28, 66, 7}, {2, 3, 7}, {5, 66, 7}};
  EXPECT_THAT(DatabaseError(folder / "database.db", model),
              HasSubstr("keypoints of image \"a.jpg\": found 3 keypoints that "
                        "are not the model's 3 2D points"));
  // Of fewer, those that see something must be among the keypoints.
  model.images[0].points2D = {{30, 4, 7}};
  EXPECT_EQ(DatabaseError(folder / "database.db", model), "");
  model.images[0].points2D = {{30, 5, 7}};
  EXPECT_THAT(DatabaseError(folder / "database.db", model),
              HasSubstr("expected the database that the model was made from"));
}

TEST(Database, IsRefusedWithTheOtherNameIfNamesAreExchanged) {
  const TempFolder folder;
  {
    DatabaseWriter writer(folder / "database.db");
    WriteImages(&writer);
    writer.AddImage(6, "c.jpg", {{10, 20}, {40, 50}});
  }
  Model model = ThreeImages();
  model.images[0].points2D = {{10, 20, 7}, {40, 50, 7}};
  model.images[2].points2D = {{2, 3, 7}, {28, 4, 7}, {5, 66, 7}};
  EXPECT_THAT(DatabaseError(folder / "database.db", model),
              HasSubstr("keypoints of image \"a.jpg\": found the 2D points of "
                        "the model's image \"c.jpg\", expected its own"));
}

TEST(Database, IsRefusedWithOneSentenceIfItIsNone) {
  const TempFolder folder;
  const fs::path path = folder / "database.db";
  EXPECT_THAT(DatabaseError(path, ThreeImages()),
              HasSubstr("cannot be opened"));
  EXPECT_THAT(DatabaseError(folder.path(), ThreeImages()),
              HasSubstr("is no regular file, expected COLMAP's database"));
  WriteBytes(path, "");
  EXPECT_THAT(DatabaseError(path, ThreeImages()),
              HasSubstr("is no SQLite database"));
  WriteBytes(path, "version https://git-lfs.github.com/spec/v1\noid sha256:4d");
  EXPECT_THAT(DatabaseError(path, ThreeImages()),
              HasSubstr("is a Git LFS pointer"));
  fs::remove(path);
  DatabaseWriter writer(path);
  WriteImages(&writer);
  writer.Execute("ALTER TABLE two_view_geometries RENAME TO inlier_matches");
  EXPECT_THAT(DatabaseError(path, ThreeImages()),
              HasSubstr("found the matches of COLMAP's first versions"));
}

TEST(Database, IsRefusedWithOneSentenceIfItContradictsItself) {
  struct Case {
    std::string sql, sentence;
  };
  const std::vector<Case> cases = {
      {"DROP TABLE keypoints", "found no table keypoints"},
      {"ALTER TABLE keypoints RENAME TO k; CREATE VIEW keypoints AS SELECT * "
       "FROM k",
       "found no table keypoints"},
      {"ALTER TABLE two_view_geometries DROP COLUMN config",
       "the table two_view_geometries is not COLMAP's (no such column: "
       "config)"},
      {"DELETE FROM images",
       "found none of the model's images, such as \"a.jpg\", expected"},
      {"UPDATE images SET name = 'left/' || name",
       "found none of the model's images, such as \"a.jpg\", but others, such "
       "as \"left/"},
      {"UPDATE images SET image_id = -1 WHERE image_id = 2",
       "found image id -1, expected 0 to 2147483646"},
      {"UPDATE images SET name = x'00' WHERE image_id = 2",
       "table images: found no text in column name, expected one there"},
      {"UPDATE keypoints SET rows = 'many'",
       "table keypoints: found no integer in column rows"},
      {"UPDATE keypoints SET data = 7",
       "table keypoints: found no blob in column data"},
      {"UPDATE keypoints SET cols = 3, rows = 2 WHERE image_id = 2",
       "keypoints of image \"b.jpg\": found 3 columns, expected 2, 4 or 6"},
      {"UPDATE keypoints SET cols = 128 WHERE image_id = 2",
       "found 128 columns, expected 2 to 6"},
      {"UPDATE keypoints SET rows = 4 WHERE image_id = 2",
       "found 24 bytes, expected 4 rows of 8"},
      {"UPDATE keypoints SET rows = 9223372036854775807 WHERE image_id = 2",
       "found 24 bytes, expected 9223372036854775807 rows of 8"},
      {"UPDATE keypoints SET rows = -3 WHERE image_id = 2",
       "found 24 bytes, expected -3 rows of 8"},
      {"UPDATE keypoints SET data = NULL WHERE image_id = 2",
       "found 0 bytes, expected 3 rows of 8"},
      {"UPDATE keypoints SET rows = 1, data = x'0000c07f00000000' WHERE "
       "image_id = 2",
       "found a coordinate of keypoint 0 that is not finite"},
      {"DELETE FROM keypoints WHERE image_id = 5",
       "found keypoint 1 of image \"a.jpg\" in a verified match, but that "
       "image has only 0 keypoints"},
      {"UPDATE two_view_geometries SET config = 10",
       "found configuration 10 of a two-view geometry, expected 0 to 9"},
      {"UPDATE two_view_geometries SET cols = 3",
       "found 3 columns, expected 2"},
      {"UPDATE two_view_geometries SET pair_id = 12 WHERE pair_id > 4294967297",
       ""},
      {"UPDATE two_view_geometries SET pair_id = 2147483647 * 5 + 5 WHERE "
       "pair_id > 4294967297",
       "found pair id 10737418240"},
  };
  for (const Case& bad : cases) {
    const TempFolder folder;
    {
      DatabaseWriter writer(folder / "database.db");
      WriteImages(&writer);
      writer.Execute(bad.sql);
    }
    const std::string error =
        DatabaseError(folder / "database.db", ThreeImages());
    EXPECT_THAT(error, HasSubstr(bad.sentence)) << bad.sql;
    if (bad.sentence.empty()) {
      EXPECT_EQ(error, "") << bad.sql;
    }
  }
  Model model = ThreeImages();
  model.images[2].name = "a.jpg";
  const TempFolder folder;
  {
    DatabaseWriter writer(folder / "database.db");
    WriteImages(&writer);
  }
  EXPECT_THAT(DatabaseError(folder / "database.db", model),
              HasSubstr("several images of the model with the name \"a.jpg\""));
}

TEST(Database, HoldsScalesOfKeypointsThatAreTheModels2DPoints) {
  const TempFolder folder;
  {
    DatabaseWriter writer(folder / "database.db");
    writer.AddImage(1, "a.jpg", kKeypoints, 2);
    writer.AddImage(2, "b.jpg", kKeypoints, 4);
    writer.AddImage(3, "c.jpg", kKeypoints, 6);
  }
  Model model = ThreeImages();
  EXPECT_TRUE(ReadDatabase(folder / "database.db", model).scales[1].empty());
  for (Image& image : model.images) {
    for (const Eigen::Vector2d& x : kKeypoints) {
      image.points2D.push_back({x.x(), x.y()});
    }
  }
  const Database database = ReadDatabase(folder / "database.db", model);
  EXPECT_TRUE(database.scales[0].empty());
  EXPECT_THAT(database.scales[1], ElementsAre(9, 9, 9));
  EXPECT_EQ(database.scales[2].size(), 3);
  EXPECT_FLOAT_EQ(database.scales[2][0], 9 * std::sqrt(2.0F));
}

TEST(Database, IsReadAsItIsWritten) {
  Model model = ThreeImages();
  model.cameras.push_back({7, 1, 640, 480, {500, 510, 320, 240}});
  for (Image& image : model.images) image.camera_id = 7;
  model.images[2].name = "it's\nodd \xff.jpg";
  Database written;
  written.keypoints = {kKeypoints, {}, kKeypoints};
  written.scales = {{1, 2, 3}, {}, {}};
  written.pairs = {{2, 0, 3, {{1, 2}, {0, 1}}}};
  const TempFolder folder;
  const fs::path path = folder / "database.db";
  for (int time = 0; time < 2; ++time) WriteDatabase(path, model, written);
  EXPECT_THAT(FileNames(folder.path()), ElementsAre("database.db"));
  const Database read = ReadDatabase(path, model);
  EXPECT_EQ(read.keypoints, written.keypoints);
  ASSERT_EQ(read.pairs.size(), 1);
  EXPECT_EQ(read.pairs[0].image1, 0);
  EXPECT_EQ(read.pairs[0].image2, 2);
  EXPECT_EQ(read.pairs[0].config, 3);
  EXPECT_THAT(read.pairs[0].matches,
              ElementsAre(ElementsAre(2u, 1u), ElementsAre(1u, 0u)));
  EXPECT_THROW(WriteDatabase(folder / "none" / "d.db", model, written),
               WriteError);
}

// Whatever a byte is: the database is read, or refused with a sentence, and
// neither it nor its folder changes.
TEST(Database, IsReadOrRefusedHoweverItIsDamaged) {
  const TempFolder folder;
  const fs::path path = folder / "database.db";
  {
    DatabaseWriter writer(path);
    WriteImages(&writer);
  }
  const std::string bytes = ReadBytes(path);
  int num_refused = 0;
  for (size_t i = 0; i < bytes.size(); i += 97) {
    for (const bool cut : {false, true}) {
      std::string damaged = bytes.substr(0, cut ? i : bytes.size());
      if (!cut) damaged[i] = static_cast<char>(damaged[i] ^ (1 + i % 255));
      WriteBytes(path, damaged);
      const std::string error = DatabaseError(path, ThreeImages());
      num_refused += error.empty() ? 0 : 1;
      if (!error.empty()) {
        EXPECT_THAT(error, HasSubstr("database.db: "));
      }
    }
  }
  EXPECT_GT(num_refused, 20);
  std::mt19937 random(1);
  for (int trial = 0; trial < 1000; ++trial) {
    std::string damaged = bytes;
    // Changed alone, in a row, or copied from elsewhere.
    for (uint32_t n = random() % 8 + 1; n > 0; --n) {
      const size_t to = random() % damaged.size();
      const size_t length =
          std::min<size_t>(random() % 64 + 1, damaged.size() - to);
      switch (random() % 3) {
        case 0:
          damaged[to] = static_cast<char>(random());
          break;
        case 1:
          damaged.replace(to, length, length, static_cast<char>(random()));
          break;
        default:
          damaged.replace(
              to, length,
              bytes.substr(random() % (bytes.size() - length), length));
      }
    }
    WriteBytes(path, damaged);
    const std::string error = DatabaseError(path, ThreeImages());
    if (!error.empty()) {
      EXPECT_THAT(error, HasSubstr("database.db: "));
    }
    ASSERT_EQ(ReadBytes(path), damaged);
    ASSERT_THAT(FileNames(folder.path()), ElementsAre("database.db"));
  }
}

}  // namespace
}  // namespace krot::internal
