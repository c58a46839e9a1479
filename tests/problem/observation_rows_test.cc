#include "krot/problem/cost.h"

#include <gtest/gtest.h>

#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

// A x + b and c'x + d of a row.
ViewedPoint Evaluate(const double row[kResidualRow], const Eigen::Vector3d& x) {
  const auto affine = [&](const double* r) {
    return r[0] * x[0] + r[1] * x[1] + r[2] * x[2] + r[3];
  };
  return {affine(row + 8), {affine(row), affine(row + 4)}};
}

class ObservationRows : public ::testing::Test {
 protected:
  const RandomScene scene_ = MakeRandomScene(
      {/*num_frames=*/3, /*num_points=*/10, /*views_per_frame=*/2,
       /*baseline=*/0.5, /*seed=*/4});

  // |v| <= 1000 px * 8 units: rounding stays below 1e-11.
  void ExpectSame(const ViewedPoint& row, const Observation& observation) {
    const ViewedPoint expected =
        ViewPoint(scene_.problem, observation, scene_.estimate);
    EXPECT_NEAR(row.depth, expected.depth, 1e-13);
    EXPECT_NEAR(row.v.x(), expected.v.x(), 1e-11);
    EXPECT_NEAR(row.v.y(), expected.v.y(), 1e-11);
  }
};

TEST_F(ObservationRows, OfAnIntersectionAreAffineInThePoint) {
  for (const Observation& observation : scene_.problem.observations) {
    const View& view = scene_.problem.views[observation.view];
    double row[kResidualRow];
    AffineRow(CamFromWorld(view, scene_.estimate.translations[view.frame]),
              observation, row);
    ExpectSame(Evaluate(row, scene_.estimate.points[observation.point]),
               observation);
  }
}

TEST_F(ObservationRows, OfAResectionAreAffineInTheTranslation) {
  for (const Observation& observation : scene_.problem.observations) {
    const View& view = scene_.problem.views[observation.view];
    double row[kResidualRow];
    ResectionRow(view, observation, scene_.estimate.points[observation.point],
                 row);
    ExpectSame(Evaluate(row, scene_.estimate.translations[view.frame]),
               observation);
  }
}

}  // namespace
}  // namespace krot::internal
