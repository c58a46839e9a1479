#include "krot/convert/certificate_file.h"

#include <openssl/sha.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "krot/context.h"
#include "krot/model/model_io.h"
#include "krot/synthetic/scene.h"
#include "tests/convert/pixel_optimum.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::HasSubstr;

using Json = nlohmann::ordered_json;

Model MakeModel(int sensors_per_rig, uint64_t seed = 1) {
  SceneOptions options = SceneOf(6, 60, 6, 0.7, seed);
  options.has_rigs = sensors_per_rig > 1;
  options.sensors_per_rig = sensors_per_rig;
  return SynthesizeScene(options).model;
}

struct Solved {
  Model model;  // at its optimum
  CertificateFile file;
};

Solved Solve(const Model& model, Norm norm) {
  BuiltProblem built = BuildProblem(model, {});
  const PixelOptimum optimum = SolveInPixels(model, norm, &built);
  EXPECT_TRUE(optimum.is_proved);
  return {ApplyEstimate(model, built, optimum.estimate),
          DescribeCertificate(model, built, norm, optimum.certificate)};
}

class CertificateOfModel : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override { solved_ = Solve(MakeModel(GetParam()), Norm::L2()); }

  std::string Refusal(const CertificateFile& file) const {
    const CertificateVerdict verdict =
        VerifyCertificateFile(solved_.model, file);
    EXPECT_NE(verdict.is_accepted, !verdict.refusal.empty());
    return verdict.refusal;
  }

  Solved solved_;
};

TEST_P(CertificateOfModel, IsAcceptedAfterAWalkThroughItsFile) {
  const std::string json = CertificateJson(solved_.file);
  const CertificateFile file = ParseCertificate(json, "c.json");
  EXPECT_EQ(CertificateJson(file), json);
  const CertificateVerdict verdict = VerifyCertificateFile(solved_.model, file);
  EXPECT_TRUE(verdict.is_accepted) << verdict.refusal;
  ASSERT_TRUE(verdict.cost && verdict.relative_gap);
  EXPECT_GE(*verdict.relative_gap, -1e-12);
  EXPECT_LE(*verdict.relative_gap, 1e-6);
  EXPECT_EQ(verdict.support.size(), file.observations.size());
  EXPECT_NEAR(verdict.support.front().error_px, *verdict.cost, 1e-10);
}

TEST_P(CertificateOfModel, HoldsForAnyTranslationsAndPoints) {
  const CertificateVerdict verdict =
      VerifyCertificateFile(MakeModel(GetParam()), solved_.file);
  EXPECT_TRUE(verdict.is_accepted) << verdict.refusal;
  ASSERT_TRUE(verdict.relative_gap);
  EXPECT_GT(*verdict.relative_gap, 1e-3);
}

// Every frame at the origin, on which no camera looks any more.
Model WithoutTranslations(Model model) {
  for (Image& image : model.images) {
    image.cam_from_world.translation.setZero();
  }
  for (Frame& frame : model.frames) {
    frame.rig_from_world.translation.setZero();
  }
  return model;
}

Model WithUnknownTranslations(Model model) {
  for (Image& image : model.images) {
    image.cam_from_world.translation[1] = std::nan("");
  }
  for (Frame& frame : model.frames) {
    frame.rig_from_world.translation[1] = std::nan("");
  }
  return model;
}

TEST_P(CertificateOfModel, HoldsWhereTheModelSeesNothingOfTheSupport) {
  for (const Model& model : {WithoutTranslations(solved_.model),
                             WithUnknownTranslations(solved_.model)}) {
    ASSERT_LT(BuildProblem(model, {}).problem.observations.size(),
              BuildProblem(solved_.model, {}).problem.observations.size());
    const CertificateVerdict verdict =
        VerifyCertificateFile(model, solved_.file);
    EXPECT_TRUE(verdict.is_accepted) << verdict.refusal;
    EXPECT_EQ(verdict.lower_bound,
              VerifyCertificateFile(solved_.model, solved_.file).lower_bound);
    EXPECT_FALSE(verdict.cost);
    EXPECT_FALSE(verdict.relative_gap);
    EXPECT_EQ(verdict.support.size(), solved_.file.observations.size());
  }
}

TEST_P(CertificateOfModel, IsRefusedWithoutTranslationsOnceItChanges) {
  const Model model = WithoutTranslations(solved_.model);
  const auto expect_refused =
      [&](const std::function<void(CertificateFile*)>& change) {
        CertificateFile file = solved_.file;
        change(&file);
        EXPECT_FALSE(VerifyCertificateFile(model, file).is_accepted);
      };
  expect_refused([](CertificateFile* f) { f->lower_bound *= 1 + 1e-6; });
  expect_refused([](CertificateFile* f) { f->model_sha256[5] ^= 1; });
  expect_refused([](CertificateFile* f) { f->observations.pop_back(); });
  expect_refused([](CertificateFile* f) { f->observations[0].image_id = 400; });
  expect_refused([](CertificateFile* f) { ++f->observations[0].point3D_id; });
  expect_refused([](CertificateFile* f) { f->rows_bound *= 1 + 1e-6; });
  expect_refused(
      [](CertificateFile* f) { f->observations[0].bearing[1] += 1e-6; });
  expect_refused([](CertificateFile* f) { f->observations[0].lambda *= 2; });
  expect_refused([](CertificateFile* f) { f->observations[0].y *= 0.5; });
}

TEST_P(CertificateOfModel, IsRefusedForAnotherModel) {
  EXPECT_THAT(
      VerifyCertificateFile(MakeModel(GetParam(), 2), solved_.file).refusal,
      HasSubstr("another model"));
}

TEST_P(CertificateOfModel, IsRefusedOnceAnythingThatItSpeaksOfChanges) {
  const auto expect_refused = [&](const std::function<void(Model*)>& change) {
    Model model = solved_.model;
    change(&model);
    EXPECT_FALSE(VerifyCertificateFile(model, solved_.file).is_accepted);
  };
  expect_refused([](Model* m) { m->cameras[0].params[0] *= 1 + 1e-15; });
  expect_refused([](Model* m) { m->cameras[0].model_id = 3; });
  expect_refused([](Model* m) { m->images[2].points2D[0].x += 1e-9; });
  expect_refused([](Model* m) {
    std::swap(m->points3D[0].track_begin, m->points3D[1].track_begin);
    std::swap(m->points3D[0].track_end, m->points3D[1].track_end);
  });
  expect_refused(
      [](Model* m) { m->frames[1].rig_from_world.quaternion_wxyz[1] += 1e-9; });
  if (!solved_.model.stores_rigs) return;
  expect_refused([](Model* m) {
    m->rigs[0].sensors[0].sensor_from_rig->translation[0] += 1e-9;
  });
  expect_refused([](Model* m) {
    m->rigs[0].sensors[0].sensor_from_rig->quaternion_wxyz[2] += 1e-9;
  });
}

TEST_P(CertificateOfModel, IsRefusedIfAnyNumberOfItsFileChanges) {
  const auto expect_refused =
      [&](const std::function<void(CertificateFile*)>& change) {
        CertificateFile file = solved_.file;
        change(&file);
        EXPECT_FALSE(VerifyCertificateFile(solved_.model, file).is_accepted);
      };
  expect_refused([](CertificateFile* f) { f->lower_bound *= 1 + 1e-6; });
  expect_refused([](CertificateFile* f) { f->lower_bound = std::nan(""); });
  expect_refused([](CertificateFile* f) { f->rows_bound *= 1 + 1e-6; });
  expect_refused([](CertificateFile* f) { f->rows_bound *= 1 - 1e-6; });
  expect_refused([](CertificateFile* f) { f->defect = 1e-3; });
  expect_refused([](CertificateFile* f) { f->model_sha256[5] ^= 1; });
  expect_refused([](CertificateFile* f) { f->norm = Norm::LInf(); });
  using Observation = CertificateFile::SupportObservation;
  double largest = 0;
  for (const Observation& o : solved_.file.observations) {
    largest = std::max(largest, o.lambda);
  }
  const double millionth = 1e-6 * largest;
  for (size_t n = 0; n < solved_.file.observations.size(); ++n) {
    SCOPED_TRACE(n);
    const auto expect_one =
        [&](const std::function<void(Observation*)>& change) {
          expect_refused(
              [&](CertificateFile* f) { change(&f->observations[n]); });
        };
    expect_one([](Observation* o) { ++o->image_id; });
    expect_one([](Observation* o) { ++o->point2D_idx; });
    expect_one([](Observation* o) { ++o->point3D_id; });
    expect_one([&](Observation* o) {
      o->bearing[1] += std::min(1e-2, millionth / o->lambda);
    });
    expect_one([](Observation* o) { o->bearing *= -1; });
    expect_one([&](Observation* o) { o->lambda += millionth; });
    expect_one([&](Observation* o) { o->y -= millionth * o->y.normalized(); });
    expect_one([](Observation* o) { o->bearing[0] = std::nan(""); });
    expect_refused([&](CertificateFile* f) {
      f->observations.erase(f->observations.begin() + static_cast<int64_t>(n));
    });
    expect_refused([&](CertificateFile* f) {
      f->observations.push_back(f->observations[n]);
    });
  }
}

// As |v|_1 >= |v|_2, what bounds the one bounds the other.
TEST_P(CertificateOfModel, HoldsForTheOneNormAsWell) {
  CertificateFile file = solved_.file;
  file.norm = Norm::L1();
  EXPECT_EQ(Refusal(file), "");
}

TEST_P(CertificateOfModel, NamesWhatDoesNotBelong) {
  CertificateFile file = solved_.file;
  file.observations[0].image_id = 4000;
  EXPECT_THAT(Refusal(file), HasSubstr("of image 4000 is not among those"));
  file = solved_.file;
  file.observations[0].point3D_id = 4000;
  EXPECT_THAT(Refusal(file), HasSubstr("is not of point 4000"));
  file = solved_.file;
  file.observations[1].bearing.setZero();
  EXPECT_THAT(Refusal(file), HasSubstr("does not project"));
  file = solved_.file;
  file.observations[1] = file.observations[0];
  EXPECT_THAT(Refusal(file), HasSubstr("twice"));
  EXPECT_EQ(Refusal(solved_.file), "");
}

INSTANTIATE_TEST_SUITE_P(SensorsPerRig, CertificateOfModel,
                         ::testing::Values(1, 2));

TEST(CertificateFile, IsReadInAnyOrderOfItsObservations) {
  Solved solved = Solve(MakeModel(1), Norm::LInf());
  std::reverse(solved.file.observations.begin(),
               solved.file.observations.end());
  EXPECT_TRUE(VerifyCertificateFile(solved.model, solved.file).is_accepted);
}

TEST(ModelSha256, DependsNeitherOnTheFormatNorOnTheOrderOfTheFiles) {
  const Model model = MakeModel(2);
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / "krot_digest_model";
  WriteModelOptions options;
  options.overwrite = true;
  for (const ModelFormat format : {ModelFormat::kText, ModelFormat::kBinary}) {
    options.format = format;
    WriteModel(model, folder, options);
    EXPECT_EQ(ModelSha256(ReadModel(folder, format)), ModelSha256(model));
  }
  std::filesystem::remove_all(folder);
  Model reversed = model;
  std::reverse(reversed.images.begin(), reversed.images.end());
  std::reverse(reversed.frames.begin(), reversed.frames.end());
  EXPECT_EQ(ModelSha256(reversed), ModelSha256(model));
}

TEST(ModelSha256, IsThatOfTheBytesThatTheFormatDefines) {
  // One SIMPLE_PINHOLE camera, no images: 1, 7, 0, 3, f, cx, cy, 0 as u64 and
  // f64. Digest by sha256sum.
  Model model;
  Camera camera;
  camera.id = 7;
  camera.params = {2, 0.5, 1};
  model.cameras.push_back(camera);
  EXPECT_EQ(ModelSha256(model),
            "5c9ab769609fe94b126b482a105b79d4ceea50438208b5a455cfd76f35122f10");
}

class WrongCertificateFile : public ::testing::Test {
 protected:
  // What ParseCertificate says about the JSON after a change.
  std::string Message(const std::function<void(Json*)>& change) const {
    Json json = Json::parse(CertificateJson(solved_.file));
    change(&json);
    return MessageOf(json.dump());
  }

  static std::string MessageOf(const std::string& text) {
    return ModelErrorOf([&] { ParseCertificate(text, "c.json"); });
  }

  Solved solved_ = Solve(MakeModel(1), Norm::L2());
};

TEST_F(WrongCertificateFile, IsNamedWithThePlaceAndWhatWasExpected) {
  EXPECT_THAT(MessageOf("{"), HasSubstr("c.json: no JSON"));
  EXPECT_THAT(MessageOf(""), HasSubstr("c.json: no JSON"));
  EXPECT_THAT(MessageOf("[]"), HasSubstr("expected an object"));
  EXPECT_THAT(MessageOf("{\"version\": 1e999}"), HasSubstr("no JSON"));
  EXPECT_THAT(Message([](Json* j) { (*j)["version"] = 3; }),
              HasSubstr("version is 3, expected 2"));
  EXPECT_THAT(Message([](Json* j) { j->erase("rows_bound"); }),
              HasSubstr("has no \"rows_bound\""));
  EXPECT_THAT(Message([](Json* j) { j->erase("norm"); }),
              HasSubstr("has no \"norm\""));
  EXPECT_THAT(Message([](Json* j) { (*j)["norm"] = "3"; }),
              HasSubstr("norm is \"3\""));
  EXPECT_THAT(Message([](Json* j) { (*j)["lower_bound"] = nullptr; }),
              HasSubstr("lower_bound is null, expected a number"));
  EXPECT_THAT(Message([](Json* j) { (*j)["observations"] = 3; }),
              HasSubstr("observations is 3, expected an array"));
  const auto observation = [&](const char* key, const Json& value) {
    return Message([&](Json* j) { (*j)["observations"][1][key] = value; });
  };
  EXPECT_THAT(observation("image_id", -1),
              HasSubstr("observations[1].image_id"));
  EXPECT_THAT(observation("image_id", 1.5), HasSubstr("expected an integer"));
  EXPECT_THAT(observation("point2D_idx", 4294967296),
              HasSubstr("[0, 4294967295]"));
  EXPECT_THAT(observation("bearing", {1, 2}),
              HasSubstr("array of three numbers"));
  EXPECT_THAT(observation("bearing", {1, 2, "3"}),
              HasSubstr("expected a number"));
  EXPECT_THAT(observation("y", {1}), HasSubstr("array of two numbers"));
  EXPECT_THAT(observation("lambda", "1"), HasSubstr("observations[1].lambda"));
}

TEST(ReadCertificateFile, SaysWhichFileCannotBeRead) {
  EXPECT_THROW(ReadCertificateFile("/nonexistent/c.json"), ModelError);
  EXPECT_THROW(ReadCertificateFile(::testing::TempDir()), ModelError);
}

TEST(Sha256, AgreesWithOpenSslAtEveryLengthAroundItsBlocks) {
  std::mt19937 random(1);
  for (size_t size = 0; size < 300; ++size) {
    std::string bytes(size, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random());
    std::array<unsigned char, 32> digest;
    SHA256(reinterpret_cast<const unsigned char*>(bytes.data()), size,
           digest.data());
    std::string expected;
    for (const unsigned char byte : digest) {
      expected += "0123456789abcdef"[byte >> 4];
      expected += "0123456789abcdef"[byte & 15];
    }
    EXPECT_EQ(Sha256(bytes), expected) << size;
  }
}

}  // namespace
}  // namespace krot::internal
