#include "krot/model/model_io.h"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/context.h"
#include "tests/testing/database_writer.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/temp_folder.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

// As SQLite writes a blob of these doubles.
std::string BlobOf(const std::vector<double>& numbers) {
  std::string text = "x'";
  for (const double number : numbers) {
    unsigned char bytes[sizeof(double)];
    std::memcpy(bytes, &number, sizeof(number));
    for (const unsigned char byte : bytes) {
      char hex[3];
      std::snprintf(hex, sizeof(hex), "%02x", byte);
      text += hex;
    }
  }
  return text + "'";
}

std::string BlobOfPosition(const Vector3d& v) {
  return BlobOf({v[0], v[1], v[2]});
}

class PosePriors : public ::testing::Test {
 protected:
  PosePriors() {
    for (size_t n = 0; n < 3; ++n) {
      model_.images.emplace_back();
      model_.images.back().id = static_cast<ImageId>(n + 10);
      model_.images.back().name =
          std::string(1, static_cast<char>('a' + n)) + ".jpg";
    }
  }

  // Images 1 to 3 of the database, and its own table.
  void Write(const std::string& sql) const {
    DatabaseWriter writer(folder_ / "database.db");
    for (int id = 1; id <= 3; ++id) {
      writer.AddImage(
          id, std::string(1, static_cast<char>('a' + id - 1)) + ".jpg", {});
    }
    writer.Execute("DROP TABLE IF EXISTS pose_priors;" + sql);
  }
  std::vector<KnownPosition> Read(const PositionsOptions& options = {}) const {
    return ReadPosePriors(folder_ / "database.db", model_, options);
  }

  static constexpr char kImageForm[] =
      "CREATE TABLE pose_priors (image_id INTEGER PRIMARY KEY NOT NULL, "
      "position BLOB, coordinate_system INTEGER NOT NULL, position_covariance "
      "BLOB);";

  TempFolder folder_;
  Model model_;
};

TEST_F(PosePriors, AreReadOfEveryColmap) {
  const std::string position = BlobOfPosition(Vector3d(1, 2, 3));
  const std::string covariance = BlobOf({4, 0, 0, 0, 9, 0, 0, 0, 16});
  for (const std::string& sql :
       {"CREATE TABLE pose_priors (image_id INTEGER PRIMARY KEY NOT NULL, "
        "position BLOB, coordinate_system INTEGER NOT NULL);"
        "INSERT INTO pose_priors VALUES (2, " +
            position + ", 1);",
        kImageForm + ("INSERT INTO pose_priors VALUES (2, " + position +
                      ", 1, " + covariance + ");"),
        "CREATE TABLE pose_priors (pose_prior_id INTEGER PRIMARY KEY NOT NULL, "
        "corr_data_id INTEGER NOT NULL, corr_sensor_id INTEGER NOT NULL, "
        "corr_sensor_type INTEGER NOT NULL, position BLOB, position_covariance "
        "BLOB, gravity BLOB, coordinate_system INTEGER NOT NULL);"
        "INSERT INTO pose_priors VALUES (7, 2, 1, 0, " +
            position + ", " + covariance + ", NULL, 1), (8, 2, 1, 1, " +
            position + ", NULL, NULL, 1);"}) {
    Write(sql);
    const auto positions = Read();
    ASSERT_EQ(positions.size(), 1u);
    EXPECT_EQ(positions[0].index, 1);
    EXPECT_EQ(positions[0].region.centre, Vector3d(1, 2, 3));
    const bool has_covariance = sql.find("covariance") != std::string::npos;
    // Three standard deviations of the x axis.
    const double along_x =
        has_covariance
            ? (positions[0].region.UnitFromWorld() * Vector3d(6, 0, 0)).norm()
            : positions[0].region.semi_axes[0];
    EXPECT_NEAR(along_x, has_covariance ? 1 : 0, 1e-12);
    std::filesystem::remove(folder_ / "database.db");
  }
}

TEST_F(PosePriors, KeepTheirCovariancesBesideOneThatCannotBeUsed) {
  const std::string position = BlobOfPosition(Vector3d(1, 2, 3));
  const std::string of = ", " + position + ", 1, ";
  Write(kImageForm +
        ("INSERT INTO pose_priors VALUES (1" + of +
         BlobOf({4, 0, 0, 0, 4, 0, 0, 0, 4}) + "), (2" + of +
         BlobOf({1, 0, 0, 0, 1, 0, 0, 0, 1e20}) + "), (3" + of + "NULL);"));
  const auto radii = [&](const PositionsOptions& options) {
    std::vector<double> found;
    for (const KnownPosition& known : Read(options)) {
      found.push_back(known.region.semi_axes[0]);
    }
    return found;
  };
  EXPECT_EQ(radii({}), (std::vector<double>{6, 0, 0}));
  PositionsOptions options;
  options.radius = 5;
  EXPECT_EQ(radii(options), (std::vector<double>{6, 5, 5}));
}

// The same places, as COLMAP 3.10 and later write them, and as 3.8 did.
TEST_F(PosePriors, OfTheImagesTableAreLatitudeLongitudeAndHeight) {
  const Vector3d places[] = {{47.5, 9.25, 400}, {47.501, 9.25, 410}};
  Write(std::string(kImageForm) + "INSERT INTO pose_priors VALUES (1, " +
        BlobOfPosition(places[0]) + ", 0, NULL), (2, " +
        BlobOfPosition(places[1]) + ", 0, NULL);");
  const auto expected = Read();
  std::filesystem::remove(folder_ / "database.db");
  Write(
      "UPDATE images SET prior_tx = 47.5, prior_ty = 9.25, prior_tz = 400 "
      "WHERE image_id = 1;"
      "UPDATE images SET prior_tx = 47.501, prior_ty = 9.25, prior_tz = 410 "
      "WHERE image_id = 2;");
  const auto positions = Read();
  ASSERT_EQ(positions.size(), 2u);  // the third image's are NULL
  for (size_t n = 0; n < 2; ++n) {
    EXPECT_EQ(positions[n].index, expected[n].index);
    EXPECT_EQ(positions[n].region.centre, expected[n].region.centre);
  }
}

// On the equator a degree of longitude is that of a circle of the semi-major
// axis a, and one of latitude nearly that of a (1 - e^2).
TEST_F(PosePriors, InLatitudesAndLongitudesBecomeEastNorthAndUp) {
  Write(std::string(kImageForm) + "INSERT INTO pose_priors VALUES (1, " +
        BlobOfPosition(Vector3d(0, 9, 100)) + ", 0, NULL), (2, " +
        BlobOfPosition(Vector3d(0.001, 9, 100)) + ", 0, NULL), (3, " +
        BlobOfPosition(Vector3d(0, 9.001, 130)) + ", 0, NULL);");
  std::string note;
  PositionsOptions options;
  options.radius = 2;
  options.on_note = [&](const std::string& sentence) { note = sentence; };
  const auto positions = Read(options);
  ASSERT_EQ(positions.size(), 3u);
  EXPECT_THAT(note, HasSubstr("east, north and up, metres, at "
                              "0.00000000 9.00000000 100.000, where "
                              "a.jpg is"));
  const double degree = std::acos(-1) / 180;
  const double a = 6378137, e2 = 0.00669437999014;
  EXPECT_LE(positions[0].region.centre.norm(), 1e-9);
  EXPECT_LE((positions[1].region.centre -
             Vector3d(0, 0.001 * degree * (a * (1 - e2) + 100), 0))
                .norm(),
            2e-3);
  EXPECT_LE(
      (positions[2].region.centre - Vector3d(0.001 * degree * (a + 130), 0, 30))
          .norm(),
      2e-3);
  EXPECT_EQ(positions[2].region.semi_axes, Vector3d::Constant(2));
}

TEST_F(PosePriors, AreRefusedWhereTheyCannotBeMeant) {
  const double nan = std::nan("");
  for (const auto& [values, part] :
       std::vector<std::pair<std::string, std::string>>{
           {"(1, " + BlobOfPosition(Vector3d(nan, 0, 0)) + ", 1, NULL)",
            "found no pose prior"},
           {"(1, " + BlobOfPosition(Vector3d(91, 0, 0)) + ", 0, NULL)",
            "found latitude 91"},
           {"(1, " + BlobOfPosition(Vector3d(1, 0, 0)) + ", 0, NULL), (2, " +
                BlobOfPosition(Vector3d(1, 0, 0)) + ", 1, NULL)",
            "found 1 of 2 pose priors in WGS84"}}) {
    Write(std::string(kImageForm) + "INSERT INTO pose_priors VALUES " + values +
          ";");
    EXPECT_THAT(ModelErrorOf([&] { Read(); }), HasSubstr(part));
    std::filesystem::remove(folder_ / "database.db");
  }
  Write("");
  EXPECT_THAT(ModelErrorOf([&] { Read(); }), HasSubstr("found no pose prior"));
}

}  // namespace
}  // namespace krot::internal
