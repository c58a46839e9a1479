#include "krot/report/text_table.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "krot/report/report_json.h"

namespace krot::internal {

std::string TextTable::ToString() const {
  std::vector<size_t> widths;
  for (const Row& row : rows_) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (size_t column = 0; column < row.size(); ++column) {
      widths[column] = std::max(widths[column], row[column].text.size());
    }
  }
  std::string text;
  for (const Row& row : rows_) {
    text += "  ";
    for (size_t column = 0; column < row.size(); ++column) {
      const std::string& cell = row[column].text;
      const std::string padding(widths[column] - cell.size(), ' ');
      const bool is_last = column + 1 == row.size();
      text +=
          column == 0 ? cell + (is_last ? "" : padding) : "  " + padding + cell;
    }
    text += '\n';
  }
  return text;
}

namespace {

// The text to which `format` sets a stream; "-" without a finite number.
template <typename... Format>
std::string NumberText(std::optional<double> value, const Format&... format) {
  if (!value || !std::isfinite(*value)) return "-";
  std::ostringstream text;
  (text << ... << format) << *value;
  return text.str();
}

}  // namespace

std::string FormatNumber(std::optional<double> value, int decimals) {
  return NumberText(value, std::fixed, std::setprecision(decimals));
}

std::string Scientific(std::optional<double> value) {
  return NumberText(value, std::scientific, std::setprecision(1));
}

std::string FormatLength(std::optional<double> value) {
  return NumberText(value, std::setprecision(4));
}

std::string Pixels(double value, int decimals) {
  return FormatNumber(value, decimals) + " px";
}

std::string Seconds(double value) { return FormatNumber(value, 2) + " s"; }

std::string TextIf(bool condition, const std::string& text) {
  return condition ? text : "";
}

std::string Counted(int64_t count, const std::string& noun) {
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

std::string Counted(int64_t count, const std::string& noun,
                    const std::string& verb_of_one,
                    const std::string& verb_of_more) {
  return Counted(count, noun) + " " + (count == 1 ? verb_of_one : verb_of_more);
}

std::string ListText(std::vector<std::string> names, size_t most) {
  if (names.size() > most) {
    names.resize(most);
    names.push_back("...");
  }
  std::string list;
  for (const std::string& name : names) {
    list += (list.empty() ? "" : ", ") + name;
  }
  return list;
}

std::string Thousands(int64_t count) {
  std::string digits = std::to_string(count);
  for (std::ptrdiff_t n = static_cast<std::ptrdiff_t>(digits.size()) - 3; n > 0;
       n -= 3) {
    digits.insert(static_cast<size_t>(n), ",");
  }
  return digits;
}

std::string FormatBytes(int64_t bytes) {
  static const char* const kUnits[] = {"B", "kB", "MB", "GB", "TB"};
  double value = static_cast<double>(bytes);
  int unit = 0;
  // Of 999.95 and more one decimal would be 1000.0.
  while (value >= (unit == 0 ? 1000 : 999.95) && unit < 4) {
    value /= 1000;
    ++unit;
  }
  return FormatNumber(value, unit == 0 ? 0 : 1) + " " + kUnits[unit];
}

Row ErrorHead(const std::string& name) {
  return {name, "observations", "max", "P99", "mean", "RMS"};
}

Row ErrorRow(const std::string& name, const PixelErrorStatistics& errors) {
  if (errors.count == 0) return {name, "0", "-", "-", "-", "-"};
  return {name,
          errors.count,
          FormatNumber(errors.max, 4),
          FormatNumber(errors.p99, 4),
          FormatNumber(errors.mean, 4),
          FormatNumber(errors.rms, 4)};
}

void AddErrorColumns(const std::vector<PixelErrorStatistics>& estimates,
                     TextTable* table) {
  const auto add = [&](const char* name, double PixelErrorStatistics::*error) {
    Row row = {name};
    for (const PixelErrorStatistics& errors : estimates) {
      row.push_back(errors.count == 0 ? "-" : FormatNumber(errors.*error, 4));
    }
    table->AddRow(row);
  };
  add("max error", &PixelErrorStatistics::max);
  add("P99 error", &PixelErrorStatistics::p99);
  add("mean error", &PixelErrorStatistics::mean);
  add("RMS error", &PixelErrorStatistics::rms);
}

std::string NotFiniteSentence(const PixelErrorStatistics& errors) {
  if (errors.not_finite == 0) return "";
  return Counted(errors.not_finite, "observation") +
         " without a finite error (behind the camera, no pose, or not "
         "projectable), in no row above.\n";
}

Json KnownIf(bool is_known, Json json) {
  for (Json& value : json) {
    if (!is_known) value = nullptr;
  }
  return json;
}

Json ErrorJson(const PixelErrorStatistics& errors) {
  return KnownIf(errors.count > 0, KROT_JSON_OF(errors, max, p99, mean, rms));
}

Json CountedErrorJson(const PixelErrorStatistics& errors) {
  return Joined(KROT_JSON_OF(errors, count, not_finite), ErrorJson(errors));
}

Json BeforeAfterJson(const PixelErrorStatistics& before,
                     const PixelErrorStatistics& after) {
  return {{"before", ErrorJson(before)}, {"after", ErrorJson(after)}};
}

Json LeftOutJson(const LeftOutCounts& left_out) {
  Json json = Json::object();
  for (const auto& [reason, count] : left_out) json[reason] = count;
  return json;
}

Json ContradictionsJson(const Contradictions& contradictions) {
  using Fit = Contradictions::Fit;
  const auto fit = [](const std::optional<Fit>& side, double Fit::*px) {
    return JsonIf(side, [&](const Fit& of_side) { return of_side.*px; });
  };
  return {{"track_elements", contradictions.num_track_elements},
          {"points2D", contradictions.num_points2D},
          {"followed", contradictions.followed.empty()
                           ? Json()
                           : Json(contradictions.followed)},
          {"median_px",
           {{"tracks", fit(contradictions.of_tracks, &Fit::median)},
            {"images", fit(contradictions.of_images, &Fit::median)}}},
          {"max_px",
           {{"tracks", fit(contradictions.of_tracks, &Fit::max)},
            {"images", fit(contradictions.of_images, &Fit::max)}}}};
}

Json PosesJson(const PoseChecks& poses) {
  return {
      {"num_far_quaternions", poses.num_far_quaternions},
      {"is_exchanged", poses.is_exchanged},
      {"num_stale_images", poses.num_stale},
      {"stale_turn_deg",
       {{"median", poses.median_turn_deg}, {"max", poses.largest_turn_deg}}}};
}

Json VerdictJson(const CertificateVerdict& verdict) {
  Json json = KROT_JSON_OF(verdict, lower_bound, cost, relative_gap);
  json["num_support"] = verdict.support.size();
  json["num_fixed_frames"] = verdict.num_fixed_images;
  json["num_fixed_points"] = verdict.num_fixed_points;
  json["num_positions"] = verdict.positions.size();
  return json;
}

Json RotationsJson(const RotationInput& rotations) {
  const ReplacedRotations& replaced = rotations.replaced;
  Json json = KROT_JSON_OF(replaced, num_frames, num_kept_images);
  json["turn_deg"] = {{"median", replaced.median_turn_deg},
                      {"max", replaced.largest_turn_deg}};
  json["frame_turn_deg"] = replaced.frame_turn_deg;
  json["median_error_px"] = {{"before", rotations.median_error_before},
                             {"after", rotations.median_error_after}};
  json["mistake"] = replaced.mistake.empty() ? Json() : Json(replaced.mistake);
  return json;
}

Json NotHeldJson(const LooseParts& loose) {
  return {{"images", ListJson(loose.images,
                              [](const LooseImage& image) {
                                return KROT_JSON_OF(image, image_id, image_name,
                                                    num_observations,
                                                    is_determined, moved);
                              })},
          {"points", ListJson(loose.points, [](const LoosePoint& point) {
             return KROT_JSON_OF(point, point3D_id, moved);
           })}};
}

std::string ReportText(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string ReportText(Json json, const RunRecord& run, const Json& seconds) {
  json["contradictions"] = ContradictionsJson(run.contradictions);
  json["poses"] = PosesJson(run.poses);
  Json& all = json["seconds"] = {{"read", run.seconds_read}};
  all.update(seconds);
  all["write"] = run.seconds_write;
  all["total"] = run.seconds_total;
  json.update(KROT_JSON_OF(run, peak_memory_bytes, threads, seed));
  return ReportText(json);
}

}  // namespace krot::internal
