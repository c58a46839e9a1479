#include "krot/report/html_page.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "krot/analysis/model_statistics.h"
#include "krot/base/numbers.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

using Json = nlohmann::json;

SyntheticScene SomeScene() {
  SceneOptions options = SceneOf(8, 60, 6, 1);
  options.start_point_noise = 0.01;
  return SynthesizeScene(options);
}

// The text of the element with this id.
std::string ElementText(const std::string& page, const std::string& id) {
  const size_t begin = page.find('>', page.find("id=\"" + id + "\"")) + 1;
  return page.substr(begin, page.find("</script>", begin) - begin);
}

// The numbers that a text in base64 stands for; by a table, digit by digit.
template <typename Number>
std::vector<Number> Decode(const std::string& text) {
  const std::string digits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<unsigned char> bytes;
  uint32_t bits = 0;
  int num_bits = 0;
  for (const char digit : text.substr(0, text.find('='))) {
    bits = bits << 6 | static_cast<uint32_t>(digits.find(digit));
    num_bits += 6;
    if (num_bits < 8) continue;
    num_bits -= 8;
    bytes.push_back(static_cast<unsigned char>(bits >> num_bits));
  }
  std::vector<Number> numbers(bytes.size() / sizeof(Number));
  std::memcpy(numbers.data(), bytes.data(), bytes.size());
  return numbers;
}

TEST(HtmlPage, HoldsTheReportAsItIs) {
  const Model model = SomeScene().model;
  const std::string report =
      R"({"command":"<!-- </script> {{models}} & \u0022 é","cost_final":0.1})";
  const std::string page = HtmlPage(report, model, model);
  EXPECT_THAT(ElementText(page, "krot-report"), Not(HasSubstr("<")));
  EXPECT_EQ(Json::parse(ElementText(page, "krot-report")), Json::parse(report));
}

TEST(HtmlPage, ReplacesAllItsPlaceholdersAndNamesNothingOutside) {
  const Model model = SomeScene().model;
  const std::string page = HtmlPage("{}", model, model);
  EXPECT_THAT(page, Not(HasSubstr("{{")));
  EXPECT_THAT(page, Not(HasSubstr("/* style.css */")));
  EXPECT_THAT(page, Not(HasSubstr("src=")));
  EXPECT_THAT(page, Not(HasSubstr("https:")));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
}

TEST(HtmlPage, LetsNoImageNameEndItsElement) {
  Model model = SomeScene().model;
  model.images[0].name = "</script><script>alert(1)</script>\xff";
  const std::string page = HtmlPage("{}", model, model);
  const Json models = Json::parse(ElementText(page, "krot-models"));
  EXPECT_EQ(models["after"]["images"][0]["name"],
            "</script><script>alert(1)</script>\xef\xbf\xbd");
}

TEST(HtmlPage, IsTheSameAtAnyNumberOfThreads) {
  const SyntheticScene scene = SomeScene();
  EXPECT_EQ(HtmlPage("{}", scene.model, scene.ground_truth, 1),
            HtmlPage("{}", scene.model, scene.ground_truth, 3));
}

TEST(ModelViewJson, HoldsEveryPointRelativeToTheOrigin) {
  const Model model = SomeScene().model;
  const Eigen::Vector3d origin(1, -2, 3);
  const Json view = Json::parse(ModelViewJson(model, origin));
  const Json& points = view["points"];
  const auto ids = Decode<uint64_t>(points["ids"]);
  const auto xyz = Decode<float>(points["xyz"]);
  const auto rgb = Decode<uint8_t>(points["rgb"]);
  const auto track_length = Decode<uint32_t>(points["track_length"]);
  ASSERT_EQ(ids.size(), model.points3D.size());
  for (size_t k = 0; k < ids.size(); ++k) {
    const Point3D& point = model.points3D[k];
    EXPECT_EQ(ids[k], point.id);
    EXPECT_EQ(track_length[k], point.track_end - point.track_begin);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_FLOAT_EQ(xyz[3 * k + axis],
                      static_cast<float>(point.xyz[axis] - origin[axis]));
      EXPECT_EQ(rgb[3 * k + axis], point.color[axis]);
    }
  }
}

TEST(ModelViewJson, HoldsTheErrorsOfItsPoints) {
  const Model model = SomeScene().model;
  const Json view =
      Json::parse(ModelViewJson(model, Eigen::Vector3d::Zero()))["points"];
  const auto max_error = Decode<float>(view["max_error"]);
  const auto mean_error = Decode<float>(view["mean_error"]);
  Model updated = model;  // its points get their mean errors
  UpdatePointErrors(PixelErrors(model), &updated);
  for (const WorstObservation& seen :
       WorstObservations(model, PixelErrors(model), 1000000)) {
    const auto index = std::find_if(
        model.points3D.begin(), model.points3D.end(),
        [&](const Point3D& point) { return point.id == seen.point3D_id; });
    const auto k = index - model.points3D.begin();
    EXPECT_GE(max_error[k], static_cast<float>(seen.error_px));
    EXPECT_FLOAT_EQ(mean_error[k],
                    static_cast<float>(updated.points3D[k].error));
  }
  EXPECT_EQ(*std::max_element(max_error.begin(), max_error.end()),
            static_cast<float>(Summarize(PixelErrors(model)).max));
}

TEST(ModelViewJson, HoldsWhereEveryImageStands) {
  const Model model = SomeScene().model;
  const Json view = Json::parse(ModelViewJson(model, Eigen::Vector3d::Zero()));
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  for (size_t i = 0; i < geometries.size(); ++i) {
    const auto center = view["images"][i]["center"].get<std::vector<double>>();
    const auto axes =
        view["images"][i]["world_from_cam"].get<std::vector<double>>();
    // The centre is seen at the origin, a place on the axis at depth 1.
    const Eigen::Vector3d on_axis(center[0] + axes[2], center[1] + axes[5],
                                  center[2] + axes[8]);
    const Eigen::Vector3d x_cam =
        geometries[i].cam_from_world.rotation * on_axis +
        geometries[i].cam_from_world.translation;
    EXPECT_LT((x_cam - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
  }
}

TEST(ModelViewJson, SaysNullForAnImageWithoutPose) {
  SceneOptions options;
  options.has_rigs = false;
  Model model = SynthesizeScene(options).model;
  model.frames[0].rig_from_world.translation.setConstant(
      std::numeric_limits<double>::quiet_NaN());
  const Json view = Json::parse(ModelViewJson(model, Eigen::Vector3d::Zero()));
  EXPECT_TRUE(view["images"][0]["center"].is_null());
  EXPECT_TRUE(view["images"][0]["pixel_error"]["max"].is_null());
  EXPECT_FALSE(view["images"][1]["center"].is_null());
}

TEST(ModelViewJson, ThinsItsPointsButNotItsNumbers) {
  const Model model = SomeScene().model;
  const Json view =
      Json::parse(ModelViewJson(model, Eigen::Vector3d::Zero(), 10));
  EXPECT_EQ(view["points"]["num"], 10);
  EXPECT_EQ(Decode<uint64_t>(view["points"]["ids"]).size(), 10u);
  EXPECT_EQ(view["num_points"], model.points3D.size());
  EXPECT_EQ(view["tail"].back()[0], model.track_elements.size());
}

TEST(SelectPoints, TakesAllWhereTheyAreFew) {
  EXPECT_EQ(SelectPoints({3, 1, 2}, 3), (std::vector<int64_t>{0, 1, 2}));
  EXPECT_TRUE(SelectPoints({}, 1).empty());
}

TEST(SelectPoints, KeepsTheWorstAndSpreadsTheOthers) {
  std::vector<float> max_errors(10000, 0.5f);
  max_errors[17] = std::numeric_limits<float>::quiet_NaN();
  const std::vector<int64_t> worst = {4001, 4002, 4003, 9999};
  for (const int64_t index : worst) max_errors[index] = 3;
  const std::vector<int64_t> selection = SelectPoints(max_errors, 400);
  ASSERT_EQ(selection.size(), 400u);
  EXPECT_TRUE(std::includes(selection.begin(), selection.end(), worst.begin(),
                            worst.end()));
  for (size_t k = 1; k < selection.size(); ++k) {
    EXPECT_GE(selection[k] - selection[k - 1], 1);
    EXPECT_LE(selection[k] - selection[k - 1], 30);
  }
}

TEST(SelectPoints, RefusesToSelectNone) {
  EXPECT_THROW(SelectPoints({1}, 0), std::invalid_argument);
}

TEST(SceneOrigin, IsTheMeanOfTheFinitePoints) {
  Model model;
  for (const double x : {1.0, 3.0, std::nan("")}) {
    model.points3D.emplace_back().xyz = Eigen::Vector3d(x, 2 * x, -x);
  }
  EXPECT_EQ(SceneOrigin(model), Eigen::Vector3d(2, 4, -2));
  EXPECT_EQ(SceneOrigin(Model()), Eigen::Vector3d::Zero().eval());
}

std::string Encode(const std::string& text) {
  return Base64(reinterpret_cast<const unsigned char*>(text.data()),
                text.size());
}

TEST(Base64, EncodesTheTestVectorsOfRfc4648) {
  EXPECT_EQ(Encode(""), "");
  EXPECT_EQ(Encode("f"), "Zg==");
  EXPECT_EQ(Encode("fo"), "Zm8=");
  EXPECT_EQ(Encode("foo"), "Zm9v");
  EXPECT_EQ(Encode("foob"), "Zm9vYg==");
  EXPECT_EQ(Encode("fooba"), "Zm9vYmE=");
  EXPECT_EQ(Encode("foobar"), "Zm9vYmFy");
}

TEST(Base64, EncodesHighBitsAndNumbersLittleEndian) {
  EXPECT_EQ(Encode("\xff\xff\xfe\xfb"), "///++w==");
  EXPECT_EQ(Base64(std::vector<uint32_t>{1, 0xff000000}), "AQAAAAAAAP8=");
}

// As real errors: most are small, a few large.
std::vector<double> SomeErrors(int count) {
  std::mt19937 random(7);
  std::lognormal_distribution<double> distribution(-1, 1.2);
  std::vector<double> errors_px(count);
  for (double& error : errors_px) error = distribution(random);
  return errors_px;
}

int64_t CountIn(const std::vector<double>& errors_px, double low, double high) {
  return std::count_if(errors_px.begin(), errors_px.end(), [&](double error) {
    return error >= low && error < high;
  });
}

TEST(ErrorHistogram, CountsWhatLiesBetweenTheEdgesOfEveryBin) {
  const std::vector<double> errors_px = SomeErrors(5000);
  const ErrorHistogram histogram = ComputeErrorHistogram(errors_px);
  for (size_t bin = 0; bin < histogram.counts.size(); ++bin) {
    const auto edge = [](size_t k) {
      return std::pow(10.0, -3 + static_cast<double>(k) / 10);
    };
    EXPECT_EQ(histogram.counts[bin],
              CountIn(errors_px, bin == 0 ? 0 : edge(bin), edge(bin + 1)));
  }
  EXPECT_GT(histogram.counts.back(), 0);
  EXPECT_EQ(std::accumulate(histogram.counts.begin(), histogram.counts.end(),
                            int64_t{0}),
            5000);
}

TEST(ErrorHistogram, PutsZeroIntoTheFirstBinAndNaNNowhere) {
  EXPECT_EQ(ComputeErrorHistogram({0, kNaN, 1e-300}).counts,
            std::vector<int64_t>{2});
  EXPECT_TRUE(ComputeErrorHistogram({kNaN}).counts.empty());
}

TEST(ErrorTail, GivesTheErrorThatHasTheRank) {
  std::vector<double> errors_px = SomeErrors(3000);
  errors_px.push_back(kNaN);
  const auto tail = ErrorTail(errors_px);
  EXPECT_EQ(tail.front().first, 1);
  EXPECT_EQ(tail.back().first, 3000);
  for (const auto& [rank, error] : tail) {
    EXPECT_EQ(CountIn(errors_px, error, 1e300), rank);  // no two are equal
  }
}

TEST(ErrorTail, SpacesRanksByAtMostFivePercentOrOne) {
  const auto tail = ErrorTail(SomeErrors(20000));
  for (size_t i = 1; i < tail.size(); ++i) {
    const int64_t step = tail[i].first - tail[i - 1].first;
    EXPECT_GE(step, 1);
    EXPECT_LE(step, std::max(1.0, 0.05 * static_cast<double>(tail[i].first)));
  }
  EXPECT_LT(tail.size(), 250u);
}

TEST(ErrorTail, OfNoErrorIsEmptyAndOfOneHoldsIt) {
  EXPECT_TRUE(ErrorTail({kNaN}).empty());
  const auto tail = ErrorTail({2.5});
  ASSERT_EQ(tail.size(), 1u);
  EXPECT_EQ(tail[0], std::make_pair(int64_t{1}, 2.5));
}

}  // namespace
}  // namespace krot::internal
