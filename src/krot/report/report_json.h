#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "krot/analysis/model_input.h"
#include "krot/convert/certificate_file.h"
#include "krot/model.h"
#include "krot/model/known_distances.h"
#include "krot/model/model_checks.h"
#include "krot/report/sentences.h"

namespace krot::internal {

// What the JSON writers of this folder share; for its .cc files alone.
using Json = nlohmann::ordered_json;

Json NumberOrNull(const std::optional<double>& value);
// Null for infinity and NaN.
Json FiniteOrNull(double value);

Json VectorJson(const Eigen::Vector3d& vector);

// {max, p99, mean, rms}, each null where nothing was counted.
Json ErrorJson(const PixelErrorStatistics& errors);

// The same behind {count, not_finite}.
Json CountedErrorJson(const PixelErrorStatistics& errors);

// The counts, by reason.
Json LeftOutJson(const LeftOutCounts& left_out);

// How often tracks and images contradict each other.
Json ContradictionsJson(const Contradictions& contradictions);

// What is odd about the poses.
Json PosesJson(const PoseChecks& poses);

// Null where there was no certificate.
Json VerdictJson(const std::optional<CertificateVerdict>& verdict);

// Null unless a file gave the rotations.
Json RotationsJson(const std::optional<RotationInput>& rotations);

// The images and points that do not hold their place.
Json NotHeldJson(const LooseParts& loose);

// The frame that known positions have of their own; null without.
struct SolveReport;
Json PositionFrameJson(const SolveReport& report);

// Null without; `names` are the keys of the models' lengths, scene units.
Json DistancesJson(const std::optional<DistanceReport>& report,
                   const std::vector<std::string>& names);

// The text of a report. Image names are bytes, not always UTF-8: what is not
// is replaced.
std::string ReportText(const Json& json);

// The same, with what every run that solves records: `seconds` are those
// between reading and writing.
std::string ReportText(Json json, const RunRecord& run, const Json& seconds);

}  // namespace krot::internal
