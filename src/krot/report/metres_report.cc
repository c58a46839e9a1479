#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

#include "krot/compare.h"
#include "krot/report/report_json.h"
#include "krot/report/reports.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

std::string Metres(double length) { return FormatLength(length) + " m"; }

}  // namespace

std::string PositionFrameSentence(const PositionFrame& frame) {
  const int64_t num_wrong = static_cast<int64_t>(frame.wrong.size());
  std::string text =
      std::to_string(frame.num_compared - num_wrong) + " of " +
      Counted(frame.num_compared, "position") + " agree with the model, to " +
      Metres(frame.median_distance) + " (median); a unit of the model is " +
      Metres(frame.own_from_model.scale);
  if (frame.radius) {
    text += "; every radius is " + Metres(*frame.radius) +
            " by their scatter, as the file has none";
  } else if (frame.tolerance > 1) {
    text += "; up to " + FormatNumber(frame.tolerance, 1) +
            " radii count as agreement, by their scatter";
  }
  return text;
}

std::string WrongPositionSentence(const WrongPosition& wrong) {
  return "the position of " + wrong.name + " is " + Metres(wrong.distance) +
         " off, its radius is " + Metres(wrong.radius) + ": left out";
}

Model InPositionFrame(const Model& solved, SolveReport* report) {
  Model moved = TransformModel(solved, report->position_frame->own_from_model);
  report->is_in_position_frame = true;
  report->summary.pixel_error_after = Summarize(PixelErrors(moved));
  return moved;
}

Json PositionFrameJson(const std::optional<PositionFrame>& position_frame,
                       bool is_written) {
  if (!position_frame) return nullptr;
  const PositionFrame& frame = *position_frame;
  const Similarity& own_from_model = frame.own_from_model;
  Json json = {
      {"scale", own_from_model.scale},
      {"quaternion_wxyz", ToWxyz(Eigen::Quaterniond(own_from_model.rotation))},
      {"translation", VectorJson(own_from_model.translation)},
      {"is_written", is_written}};
  json.update(
      KROT_JSON_OF(frame, num_compared, median_distance, tolerance, radius));
  json["wrong"] = ListJson(frame.wrong, [](const WrongPosition& position) {
    return KROT_JSON_OF(position, name, distance, radius);
  });
  return json;
}

namespace {

// The length in metres, or in scene units if no scale is known.
double LengthIn(const MeasuredDistances& measured, size_t n) {
  return measured.lengths[n] * (measured.scale ? measured.scale->scale : 1);
}

bool IsContradicted(const DistanceReport& report, size_t n) {
  const MeasuredDistances& last = report.models.back();
  return report.distances[n].metres && last.scale &&
         std::isfinite(last.lengths[n]) && last.scale->agrees[n] == 0;
}

std::string ScaleWords(const MeasuredDistances& measured) {
  const DistanceScale& scale = *measured.scale;
  return "a unit of the model is " + Metres(scale.scale) +
         TextIf(scale.lowest < scale.highest,
                " (" + FormatLength(scale.lowest) + " to " +
                    FormatLength(scale.highest) + ")") +
         " by " + Counted(scale.num_agreeing, "distance") +
         TextIf(!scale.is_unique,
                ", though others that contradict them are as many");
}

}  // namespace

std::vector<std::string> ContradictedDistances(const DistanceReport& report) {
  std::vector<std::string> sentences;
  for (size_t n = 0; n < report.distances.size(); ++n) {
    if (!IsContradicted(report, n)) continue;
    const KnownDistance& distance = report.distances[n];
    sentences.push_back(
        "the distance of " + report.names[n] + " is " +
        Metres(LengthIn(report.models.back(), n)) + " by the scale of the " +
        "others, not " + Metres(*distance.metres) + " to within " +
        Metres(distance.tolerance) + ": they contradict each other");
  }
  return sentences;
}

std::string DistanceTable(const DistanceReport& report,
                          const std::vector<std::string>& heads) {
  const bool has_scale = report.models.back().scale.has_value();
  Row head = {"", "known", "within"};
  head.insert(head.end(), heads.begin(), heads.end());
  head.push_back("off");
  TextTable table(std::move(head));
  for (size_t n = 0; n < report.distances.size(); ++n) {
    const KnownDistance& distance = report.distances[n];
    Row row = {report.names[n], FormatLength(distance.metres),
               distance.metres ? FormatLength(distance.tolerance) : "-"};
    for (const MeasuredDistances& measured : report.models) {
      row.push_back(FormatNumber(LengthIn(measured, n), 4));
    }
    const double last = LengthIn(report.models.back(), n);
    row.push_back(distance.metres && has_scale
                      ? FormatNumber(last - *distance.metres, 4) +
                            (IsContradicted(report, n) ? " !" : "")
                      : "-");
    table.AddRow(std::move(row));
  }
  std::string text = "\nDistances, ";
  text += has_scale ? "metres: " + ScaleWords(report.models.back())
                    : std::string("scene units");
  text += "\n" + table.ToString();
  for (const std::string& sentence : ContradictedDistances(report)) {
    text += "! " + sentence + ".\n";
  }
  return text;
}

Json DistancesJson(const std::optional<DistanceReport>& report,
                   const std::vector<std::string>& names) {
  if (!report) return nullptr;
  Json list = Json::array();
  for (size_t n = 0; n < report->distances.size(); ++n) {
    const KnownDistance& distance = report->distances[n];
    Json entry = {
        {"name", report->names[n]},
        {"metres", distance.metres},
        {"tolerance", distance.metres ? Json(distance.tolerance) : Json()},
        {"is_contradicted", IsContradicted(*report, n)}};
    for (size_t model = 0; model < names.size(); ++model) {
      entry[names[model]] = report->models[model].lengths[n];
    }
    list.push_back(std::move(entry));
  }
  Json scales = Json::object();
  for (size_t model = 0; model < names.size(); ++model) {
    scales[names[model]] =
        JsonIf(report->models[model].scale, [](const DistanceScale& scale) {
          return Joined(
              {{"metres_per_unit", scale.scale}},
              KROT_JSON_OF(scale, lowest, highest, num_agreeing, is_unique));
        });
  }
  return {{"is_scale_taken", report->is_scale_taken},
          {"scales", std::move(scales)},
          {"distances", std::move(list)}};
}

std::string AdjustedDistanceTable(const DistanceComparison& comparison) {
  TextTable table(
      {"", "known", "within", "adjusted", "sigma", "off", "r", "w"});
  int64_t num_taking_part = 0;
  std::string wrong;
  for (const DistanceComparison::Distance& distance : comparison.distances) {
    num_taking_part += distance.takes_part ? 1 : 0;
    table.AddRow(
        {distance.name, FormatNumber(distance.metres, 6),
         distance.metres ? FormatNumber(distance.tolerance, 6) : "-",
         FormatNumber(distance.length, 6), FormatNumber(distance.sigma, 6),
         FormatNumber(distance.Off(), 6) +
             TextIf(distance.IsContradicted(), " !"),
         FormatNumber(distance.redundancy, 3), FormatNumber(distance.w, 2)});
    if (!distance.IsContradicted()) continue;
    wrong +=
        "! The distance of " + distance.name + " is " +
        Metres(distance.length) +
        (distance.is_wrong ? " by all the rest" : "") + ", not " +
        Metres(*distance.metres) + " to within " + Metres(distance.tolerance) +
        (distance.is_wrong ? ": left out.\n"
                           : ": the others or the images contradict it.\n");
  }
  std::string text = "\nDistances, scene units";
  if (comparison.is_metric) {
    text = "\nDistances, metres: " + Counted(num_taking_part, "known one") +
           " took part";
  }
  if (comparison.metres_per_unit) {
    text += "; a unit of the model that was read is about " +
            Metres(*comparison.metres_per_unit);
  }
  return text + "\n" + table.ToString() + wrong;
}

Json AdjustedDistancesJson(
    const std::optional<DistanceComparison>& comparison) {
  if (!comparison) return nullptr;
  return {{"metres_per_unit", comparison->metres_per_unit},
          {"distances", ListJson(comparison->distances, [](const auto& of) {
             Json json = {
                 {"name", of.name},
                 {"metres", of.metres},
                 {"tolerance", of.metres ? Json(of.tolerance) : Json()},
                 {"takes_part", of.takes_part},
                 {"is_contradicted", of.IsContradicted()},
                 {"after", of.length}};
             json.update(KROT_JSON_OF(of, sigma, redundancy, w));
             return json;
           })}};
}

}  // namespace krot::internal
