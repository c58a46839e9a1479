#pragma once

#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "krot/analysis/model_input.h"
#include "krot/convert/certificate_json.h"
#include "krot/model.h"
#include "krot/model/model_checks.h"
#include "krot/model/model_io.h"
#include "krot/report/sentences.h"

namespace krot::internal {

// What the JSON writers share; only .cc files of this folder use this header.
using Json = CertificateFileJson;

// The name of an enum's value; the first one's for values that are not listed.
template <typename Enum>
const char* NameIn(std::initializer_list<std::pair<Enum, const char*>> names,
                   Enum value) {
  for (const auto& [one, name] : names) {
    if (one == value) return name;
  }
  return names.begin()->second;
}

template <typename Number>
Json NumberOrNull(const std::optional<Number>& value) {
  return value ? Json(*value) : Json();
}
// Null for infinity and NaN.
Json FiniteOrNull(double value);

// An observation's ids and image name, and `more`.
template <typename Observation>
Json ObservationJson(const Observation& o, const Json& more) {
  Json json = {{"image_id", o.image_id},
               {"image_name", o.image_name},
               {"point2D_idx", o.point2D_idx},
               {"point3D_id", o.point3D_id}};
  json.update(more);
  return json;
}

// {max, p99, mean, rms}, each null if nothing was counted.
Json ErrorJson(const PixelErrorStatistics& errors);

// {count, not_finite} and these.
Json CountedErrorJson(const PixelErrorStatistics& errors);

// An object that maps each reason to its count.
Json LeftOutJson(const LeftOutCounts& left_out);

// How often tracks and images contradict each other.
Json ContradictionsJson(const Contradictions& contradictions);

// The suspicious properties of the poses.
Json PosesJson(const PoseChecks& poses);

// Null if there is no certificate.
Json VerdictJson(const std::optional<CertificateVerdict>& verdict);

// Null unless the rotations come from a file.
Json RotationsJson(const std::optional<RotationInput>& rotations);

// The images and points that do not hold their place.
Json NotHeldJson(const LooseParts& loose);

// The known positions' own frame; null if they have none.
struct SolveReport;
Json PositionFrameJson(const std::optional<PositionFrame>& position_frame,
                       bool is_written);

// Null without a report; `names` are the keys under which the lengths in each
// model are written, scene units.
Json DistancesJson(const std::optional<DistanceReport>& report,
                   const std::vector<std::string>& names);

struct DistanceComparison;
Json AdjustedDistancesJson(const std::optional<DistanceComparison>& comparison);

// The text of a report. Image names are bytes; sequences that are not UTF-8 are
// replaced.
std::string ReportText(const Json& json);

// The same, together with what every run that solves records; `seconds` are
// those of the steps between reading and writing.
std::string ReportText(Json json, const RunRecord& run, const Json& seconds);

}  // namespace krot::internal
