#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/analysis/model_input.h"
#include "krot/base/numbers.h"
#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/pipeline/adjust_model.h"

namespace krot::internal {

// Figures that the reports on a precision derive from it.

// A test with 0.1 % false alarms detects an error of delta0 sigma / sqrt(r) in
// an observation with a probability of 80 % [Baarda 1968].
inline constexpr double kDelta0 = 4.13;

// An observation with its ids and figures.
struct NamedObservation {
  const ObservationPrecision* precision = nullptr;
  const Image* image = nullptr;
  uint32_t point2D_idx = 0;
  Point3DId point3D_id = 0;
  double error_px = 0;
  double w = kNaN;

  // The smallest detectable error of its worse coordinate, pixels.
  double DetectablePx(double sigma0_px) const {
    return kDelta0 * sigma0_px / std::sqrt(precision->redundancy.minCoeff());
  }
};

// The figures that are derived from a precision.
struct PrecisionFigures {
  // Keeps a reference to `precision`, which must be the model's.
  PrecisionFigures(const AdjustmentPrecision& precision, const Model& model);

  std::vector<NamedObservation> LargestResiduals() const;
  std::vector<NamedObservation> LargestW() const;
  std::vector<PointPrecision> SmallestAngles() const;
  // Root mean square of the determined points' standard deviations.
  Eigen::Vector3d RmsSigma() const;
  double MedianDetectablePx() const;

  std::vector<NamedObservation> all;
  std::map<int, int64_t> num_with_rays;
  double mean_angle_deg = 0;
  int64_t num_tested = 0;
  // Observations of which one direction or both are not controlled.
  int64_t num_uncontrolled = 0;
  double critical_w = kNaN;
  int64_t num_above = 0;

 private:
  // The observations with the largest `key`; those whose key is NaN are
  // skipped.
  template <typename Key>
  std::vector<NamedObservation> Worst(const Key& key) const;

  static constexpr size_t kWorstRows = 20;

  const AdjustmentPrecision& precision_;
};

// The standard deviations: square roots of the diagonal.
Eigen::VectorXd Deviations(const Eigen::MatrixXd& covariance);

// The names of a camera model's parameters: "f", "cx", "cy", "k".
std::vector<std::string> ParamNames(int model_id);

// The precision for report.json: sigma0, redundancy, standard deviations and
// reliability.
nlohmann::ordered_json PrecisionJson(const AdjustmentPrecision& precision,
                                     const Model& model);
std::string PrecisionSentence(const AdjustmentPrecision& precision);

// ---- What is surveyed ----

// Surveyed points and cameras, compared with those of a model.
struct SurveyComparison {
  struct Place {
    std::string name;           // "a.jpg" or "3D point 12"
    Point3DId point3D_id = {};  // of a point
    Eigen::Vector3d surveyed = Eigen::Vector3d::Zero();
    // The model's position minus the surveyed one.
    Eigen::Vector3d difference = Eigen::Vector3d::Zero();
    // The difference in the standard deviations of the surveyed position.
    double deviations = 0;
  };

  bool is_fitted = false;  // to these positions
  double scale = 1;        // the survey's unit, for one unit of the model
  double rms = 0;          // length of the differences
  std::vector<Place> places;
};

// In the survey's frame and unit, after `survey_from_model`, or without it
// after the similarity that fits the model best to the survey; then none if
// there are fewer than three positions, or if they are on a line. Images
// without a pose are left out; none if nothing else is there.
std::optional<SurveyComparison> CompareWithSurvey(
    const Model& model, const std::vector<KnownPosition>& surveyed,
    const std::optional<Similarity>& survey_from_model = {});

// For report.json; null if there are none.
nlohmann::ordered_json SurveyJson(const std::optional<SurveyComparison>& survey,
                                  bool are_points);

// The known positions of a bundle adjustment, and in which frame it is done.
class Survey {
 public:
  // With `in_own_frame`, moves the model into the positions' frame if they have
  // one.
  Survey(KnownPositions known, bool in_own_frame, Model* model);

  // In the frame of the model.
  const std::vector<KnownPosition>& positions() const { return positions_; }
  const std::optional<PositionFrame>& frame() const { return frame_; }
  // The survey's unit, for one unit of the model; none without positions.
  std::optional<double> scale() const {
    if (surveyed_.empty()) return std::nullopt;
    return survey_from_model_.scale;
  }
  bool is_in_own_frame() const { return is_in_own_frame_; }

  // The adjusted model beside the known positions; none without any.
  std::optional<SurveyComparison> ComparePositions(const Model& adjusted) const;
  // Beside check points: in the frame of the known positions or, without any,
  // after the similarity that fits best.
  std::optional<SurveyComparison> CompareCheckPoints(
      const Model& adjusted,
      const std::vector<KnownPosition>& check_points) const;

 private:
  std::vector<KnownPosition> positions_, surveyed_;
  std::optional<PositionFrame> frame_;
  bool is_in_own_frame_ = false;
  Similarity survey_from_model_;
};

// Known distances beside those of an adjusted model.
struct DistanceComparison {
  struct Distance {
    std::string name;  // "a.jpg to b.jpg"
    std::optional<double> metres;
    double tolerance = 0;
    bool takes_part = false;
    bool is_wrong = false;  // left out
    double length = 0;      // NaN if the model does not have it
    double sigma = kNaN;    // of the length; infinite if it is not determined
    double redundancy = kNaN;
    double w = kNaN;

    double Off() const { return length - metres.value_or(kNaN); }
    bool IsContradicted() const {
      return is_wrong || (takes_part && std::abs(Off()) > tolerance);
    }
  };

  bool is_metric = false;  // in metres; else in the model's unit
  // By which the model that was read was scaled; none if something else holds
  // its scale, or no distance is known.
  std::optional<double> metres_per_unit;
  std::vector<Distance> distances;
};

// The known distances of a bundle adjustment. Those without metres are only
// measured.
class DistanceSurvey {
 public:
  // Scales the model to metres by the median of what the distances say, unless
  // something else holds its scale: `held_metres_per_unit`.
  DistanceSurvey(std::vector<KnownDistance> distances,
                 std::optional<double> held_metres_per_unit, Model* model);

  // In the model's unit.
  const std::vector<KnownDistance>& distances() const { return distances_; }

  // None without distances.
  std::optional<DistanceComparison> Compare(
      const Model& adjusted, const AdjustModelSummary& summary) const;

 private:
  std::vector<KnownDistance> distances_;
  bool is_metric_ = false;
  std::optional<double> scaled_by_;
  double metres_per_unit_ = 1;  // of the model that is adjusted
};

}  // namespace krot::internal
