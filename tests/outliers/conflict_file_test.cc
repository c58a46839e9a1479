#include "krot/convert/certificate_file.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/context.h"
#include "krot/outliers/removal.h"
#include "tests/outliers/outlier_scenes.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

using ::testing::HasSubstr;

struct Packed {
  Model model;
  ConflictFile file;
};

Packed PackScene(bool has_own_bounds) {
  Packed result;
  result.model = MakeOutlierScene(1, 0.05).model;
  BuiltProblem built = BuildProblem(result.model, {});
  if (has_own_bounds) {
    std::vector<double> scales;
    for (size_t i = 0; i < built.pixels.size(); ++i) {
      scales.push_back(i % 3 == 0 ? 1 : 0.7);
    }
    ScaleObservations(scales, &built);
  }
  std::vector<PixelCertificate> proofs;
  for (const Conflict& conflict :
       DisjointConflicts(result.model, built, {Norm::L2(), 2})) {
    proofs.push_back(conflict.proof);
  }
  result.file = DescribeConflicts(result.model, built, Norm::L2(), 2, proofs);
  return result;
}

const Packed& PackedScene() {
  static const Packed packed = PackScene(false);
  return packed;
}

const Packed& PackedWithOwnBounds() {
  static const Packed packed = PackScene(true);
  return packed;
}

TEST(ConflictFile, ComesBackWithTheSameBitsAndHolds) {
  const auto& [model, file] = PackedScene();
  ASSERT_GE(file.conflicts.size(), 2u);
  const std::string json = ConflictJson(file);
  EXPECT_TRUE(HoldsConflicts(json));
  EXPECT_EQ(ConflictJson(ParseConflicts(json, "file")), json);
  const ConflictVerdict verdict =
      VerifyConflictFile(model, ParseConflicts(json, "file"));
  EXPECT_TRUE(verdict.is_accepted) << verdict.refusal;
  EXPECT_EQ(verdict.num_conflicts, static_cast<int64_t>(file.conflicts.size()));
}

TEST(ConflictFile, HoldsWhateverTheTranslationsAndPointsAre) {
  auto [model, file] = PackedScene();
  for (Frame& frame : model.frames) frame.rig_from_world.translation.setZero();
  for (Image& image : model.images) image.cam_from_world.translation.setZero();
  for (Point3D& point : model.points3D) point.xyz = {1, 2, 3};
  EXPECT_TRUE(VerifyConflictFile(model, file).is_accepted);
}

TEST(ConflictFile, IsRefusedOnceItIsTamperedWith) {
  struct Tampering {
    const char* refusal;
    std::function<void(ConflictFile*)> change;
  };
  const std::vector<Tampering> tamperings = {
      {"another model", [](auto* f) { f->model_sha256[0] ^= 1; }},
      {"not above max_error", [](auto* f) { f->max_error = 500; }},
      {"no positive number", [](auto* f) { f->max_error = 0; }},
      {"is there twice",
       [](auto* f) { f->conflicts.push_back(f->conflicts.front()); }},
      {"is there twice",
       [](auto* f) {
         f->conflicts[1].observations.push_back(
             f->conflicts[0].observations[0]);
       }},
      {"conflict 1: ",
       [](auto* f) { f->conflicts[0].observations.pop_back(); }},
      {"conflict 1: ",
       [](auto* f) { f->conflicts[0].observations[0].lambda *= 1.01; }},
      {"conflict 1: ",
       [](auto* f) { f->conflicts[0].observations[0].y *= 0.9; }},
      {"conflict 1: ",
       [](auto* f) {
         f->conflicts[0].lower_bound = 1.01 * f->conflicts[0].rows_bound;
       }},
      {"conflict 1: ",
       [](auto* f) {
         f->conflicts[0].observations[0].bearing = {0, 0, -1};
       }},
      {"is empty", [](auto* f) { f->conflicts[0].observations.clear(); }},
  };
  for (const Tampering& tampering : tamperings) {
    auto [model, file] = PackedScene();
    tampering.change(&file);
    const ConflictVerdict verdict = VerifyConflictFile(model, file);
    EXPECT_FALSE(verdict.is_accepted);
    EXPECT_THAT(verdict.refusal, HasSubstr(tampering.refusal));
  }
}

TEST(ConflictFile, WithABoundForEachObservationHoldsForThese) {
  const auto& [model, file] = PackedWithOwnBounds();
  ASSERT_GE(file.conflicts.size(), 2u);
  const std::string json = ConflictJson(file);
  EXPECT_EQ(ConflictJson(ParseConflicts(json, "file")), json);
  const ConflictVerdict verdict =
      VerifyConflictFile(model, ParseConflicts(json, "file"));
  EXPECT_TRUE(verdict.is_accepted) << verdict.refusal;
  EXPECT_TRUE(verdict.has_own_bounds);
  EXPECT_EQ(verdict.num_conflicts, static_cast<int64_t>(file.conflicts.size()));
  EXPECT_FALSE(VerifyConflictFile(model, PackedScene().file).has_own_bounds);
}

TEST(ConflictFile, IsRefusedWhereItsBoundsAreTamperedWith) {
  const std::vector<std::pair<const char*, std::function<void(ConflictFile*)>>>
      tamperings = {
          {"not one bound per observation",
           [](auto* f) { f->conflicts[0].max_errors.pop_back(); }},
          {"not one bound per observation",
           [](auto* f) { f->conflicts[0].max_errors[0] = 0; }},
          {"not one bound per observation",
           [](auto* f) { f->conflicts[0].max_errors[0] = 3; }},
          {"conflict 1: ",
           [](auto* f) {
             for (double& bound : f->conflicts[0].max_errors) bound = 2;
           }},
          {"conflict 1: ", [](auto* f) { f->version = 1; }},
      };
  for (const auto& [refusal, change] : tamperings) {
    auto [model, file] = PackedWithOwnBounds();
    change(&file);
    const ConflictVerdict verdict = VerifyConflictFile(model, file);
    EXPECT_FALSE(verdict.is_accepted);
    EXPECT_THAT(verdict.refusal, HasSubstr(refusal));
  }
}

TEST(ConflictFile, NamesThePlaceThatCannotBeRead) {
  const std::string json = ConflictJson(PackedScene().file);
  const auto message = [](const std::string& text) {
    return ModelErrorOf([&] { ParseConflicts(text, "name"); });
  };
  EXPECT_THAT(message("{"), HasSubstr("name: no JSON"));
  EXPECT_THAT(message("{\"version\": 7}"), HasSubstr("version is 7"));
  std::string no_lambda = json;
  no_lambda.replace(no_lambda.find("\"lambda\""), 8, "\"lambda_\"");
  EXPECT_THAT(message(no_lambda),
              HasSubstr("conflicts[0].observations[0] has no \"lambda\""));
}

}  // namespace
}  // namespace krot::internal
