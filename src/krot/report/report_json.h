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
#include "krot/database.h"
#include "krot/model.h"
#include "krot/model/model_checks.h"
#include "krot/model/model_io.h"
#include "krot/outliers/match_tracks.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/report/sentences.h"

// An empty optional is written as null.
template <typename Value>
struct nlohmann::adl_serializer<std::optional<Value>> {
  template <typename Json>
  static void to_json(Json& json, const std::optional<Value>& value) {
    if (value) {
      json = *value;
    } else {
      json = nullptr;
    }
  }
};

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

// An object with these members of `object`, under their own names: a member
// that is renamed needs its key written out. Null stands for an empty optional
// and, in the text, for what is not finite.
#define KROT_JSON_MEMBER(member) members[#member] = object_of.member;
#define KROT_JSON_OF(object, ...)                                            \
  [](const auto& object_of) {                                                \
    Json members;                                                            \
    NLOHMANN_JSON_EXPAND(NLOHMANN_JSON_PASTE(KROT_JSON_MEMBER, __VA_ARGS__)) \
    return members;                                                          \
  }(object)

// What `of` makes of a value that there is; otherwise null.
template <typename Value, typename Of>
Json JsonIf(const std::optional<Value>& value, const Of& of) {
  return value ? Json(of(*value)) : Json();
}

// The one object and then the members of the other.
inline Json Joined(Json json, const Json& more) {
  json.update(more);
  return json;
}

// An observation's ids and image name, and `more`.
template <typename Observation>
Json ObservationJson(const Observation& o, const Json& more) {
  return Joined(KROT_JSON_OF(o, image_id, image_name, point2D_idx, point3D_id),
                more);
}

// The object, each of its values null if they are not known.
Json KnownIf(bool is_known, Json json);

// {max, p99, mean, rms}, each null if nothing was counted.
Json ErrorJson(const PixelErrorStatistics& errors);

// {count, not_finite} and these.
Json CountedErrorJson(const PixelErrorStatistics& errors);

// {before, after}, with these for each.
Json BeforeAfterJson(const PixelErrorStatistics& before,
                     const PixelErrorStatistics& after);

// An object that maps each reason to its count.
Json LeftOutJson(const LeftOutCounts& left_out);

// How often tracks and images contradict each other.
Json ContradictionsJson(const Contradictions& contradictions);

// The suspicious properties of the poses.
Json PosesJson(const PoseChecks& poses);

// An accepted certificate.
Json VerdictJson(const CertificateVerdict& verdict);

// Rotations that come from a file.
Json RotationsJson(const RotationInput& rotations);

// The images and points that do not hold their place.
Json NotHeldJson(const LooseParts& loose);

// How many observations were removed, and how many must go.
Json OutlierCountsJson(const OutlierFilterSummary& summary);

// What the matches of a database say about a model's poses; docs/cli.md lists
// the keys.
Json PairJson(const PairCheck& check);

// What became of the matches of a database.
Json MatchesJson(const MatchTracksSummary& summary);

// OutlierFilterSummary::weak_parts.
Json WeakPartsJson(const OutlierFilterSummary& summary);

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
