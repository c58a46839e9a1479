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
  Json wrong =
      ListJson(frame.wrong, [&](const WrongPosition& position) -> Json {
        return {{"name", position.name},
                {"distance", position.distance},
                {"radius", position.radius}};
      });
  const Similarity& own_from_model = frame.own_from_model;
  return {
      {"scale", own_from_model.scale},
      {"quaternion_wxyz", ToWxyz(Eigen::Quaterniond(own_from_model.rotation))},
      {"translation", VectorJson(own_from_model.translation)},
      {"is_written", is_written},
      {"num_compared", frame.num_compared},
      {"median_distance", frame.median_distance},
      {"tolerance", frame.tolerance},
      {"radius", NumberOrNull(frame.radius)},
      {"wrong", std::move(wrong)}};
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
         (scale.lowest < scale.highest
              ? " (" + FormatLength(scale.lowest) + " to " +
                    FormatLength(scale.highest) + ")"
              : std::string()) +
         " by " + Counted(scale.num_agreeing, "distance") +
         (scale.is_unique ? ""
                          : ", though others that contradict them are as many");
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
  TextTable table;
  std::vector<std::string> head = {"", "known", "within"};
  head.insert(head.end(), heads.begin(), heads.end());
  head.push_back("off");
  table.AddRow(std::move(head));
  for (size_t n = 0; n < report.distances.size(); ++n) {
    const KnownDistance& distance = report.distances[n];
    std::vector<std::string> row = {
        report.names[n], distance.metres ? FormatLength(*distance.metres) : "-",
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
        {"metres", NumberOrNull(distance.metres)},
        {"tolerance", distance.metres ? Json(distance.tolerance) : Json()},
        {"is_contradicted", IsContradicted(*report, n)}};
    for (size_t model = 0; model < names.size(); ++model) {
      entry[names[model]] = FiniteOrNull(report->models[model].lengths[n]);
    }
    list.push_back(std::move(entry));
  }
  Json scales = Json::object();
  for (size_t model = 0; model < names.size(); ++model) {
    const std::optional<DistanceScale>& scale = report->models[model].scale;
    scales[names[model]] = scale ? Json({{"metres_per_unit", scale->scale},
                                         {"lowest", scale->lowest},
                                         {"highest", scale->highest},
                                         {"num_agreeing", scale->num_agreeing},
                                         {"is_unique", scale->is_unique}})
                                 : Json();
  }
  return {{"is_scale_taken", report->is_scale_taken},
          {"scales", std::move(scales)},
          {"distances", std::move(list)}};
}

std::string AdjustedDistanceTable(const DistanceComparison& comparison) {
  const auto number = [](double value, int digits) {
    return std::isfinite(value) ? FormatNumber(value, digits) : "-";
  };
  TextTable table;
  table.AddRow({"", "known", "within", "adjusted", "sigma", "off", "r", "w"});
  int64_t num_taking_part = 0;
  std::string wrong;
  for (const DistanceComparison::Distance& distance : comparison.distances) {
    num_taking_part += distance.takes_part ? 1 : 0;
    std::vector<std::string> row = {distance.name, "-", "-"};
    if (distance.metres) {
      row[1] = FormatNumber(*distance.metres, 6);
      row[2] = FormatNumber(distance.tolerance, 6);
    }
    row.push_back(number(distance.length, 6));
    row.push_back(number(distance.sigma, 6));
    row.push_back(number(distance.Off(), 6) +
                  (distance.IsContradicted() ? " !" : ""));
    row.push_back(number(distance.redundancy, 3));
    row.push_back(number(distance.w, 2));
    table.AddRow(std::move(row));
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
  Json list =
      ListJson(comparison->distances, [&](const auto& distance) -> Json {
        return {
            {"name", distance.name},
            {"metres", NumberOrNull(distance.metres)},
            {"tolerance", distance.metres ? Json(distance.tolerance) : Json()},
            {"takes_part", distance.takes_part},
            {"is_contradicted", distance.IsContradicted()},
            {"after", FiniteOrNull(distance.length)},
            {"sigma", FiniteOrNull(distance.sigma)},
            {"redundancy", FiniteOrNull(distance.redundancy)},
            {"w", FiniteOrNull(distance.w)}};
      });
  return {{"metres_per_unit", NumberOrNull(comparison->metres_per_unit)},
          {"distances", std::move(list)}};
}

}  // namespace krot::internal
