#include "krot/report/reports.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <sstream>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/report/report_json.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

constexpr const char* kAxes[] = {"x", "y", "z"};

// The number of decimals that shows three digits of the narrowest interval.
int DecimalsFor(const std::vector<ToleranceBox>& boxes) {
  double narrowest = 0;
  for (const ToleranceBox& box : boxes) {
    for (int axis = 0; axis < 3; ++axis) {
      const double width =
          box.box.high[axis].reached - box.box.low[axis].reached;
      if (width > 0 && (narrowest == 0 || width < narrowest)) narrowest = width;
    }
  }
  if (narrowest == 0) return 6;
  return std::clamp(2 - static_cast<int>(std::floor(std::log10(narrowest))), 0,
                    12);
}

std::string EndText(const BoxEnd& end, int decimals) {
  return end.proved ? FormatNumber(*end.proved, decimals) : "-";
}

// The length of the box's longest side; infinite if an end is not proved.
double Width(const ToleranceBox& box) {
  double width = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const BoxEnd& low = box.box.low[axis];
    const BoxEnd& high = box.box.high[axis];
    if (!low.proved || !high.proved) {
      return std::numeric_limits<double>::infinity();
    }
    width = std::max(width, *high.proved - *low.proved);
  }
  return width;
}

// All boxes in their order or, if they are more than `max_rows`, the widest.
std::vector<ToleranceBox> Listed(std::vector<ToleranceBox> boxes,
                                 size_t max_rows) {
  if (boxes.size() <= max_rows) return boxes;
  SortLargestFirst(&boxes, &Width);
  boxes.resize(max_rows);
  return boxes;
}

const char* ToleranceTerminationName(ToleranceTermination termination) {
  using Enum = ToleranceTermination;
  return NameIn<Enum>({{Enum::kNotRun, "not_run"},
                       {Enum::kNothingToSolve, "nothing_to_solve"},
                       {Enum::kNoEstimate, "no_estimate"},
                       {Enum::kDone, "done"},
                       {Enum::kInterrupted, "interrupted"}},
                      termination);
}

std::string GaugeSentence(const ToleranceSummary& summary) {
  if (summary.gauge_images.empty()) {
    return "Place and scale are those of " +
           Counted(summary.num_fixed_frames, "fixed frame") + " and " +
           Counted(summary.num_fixed_points, "fixed point") + ".\n";
  }
  const std::string first = summary.gauge_images.front() + " stands still";
  if (summary.gauge_images.size() == 1) return first + ".\n";
  return first + "; " + summary.gauge_images.back() +
         " keeps its distance along the line between the two.\n";
}

Json EndsJson(const std::array<BoxEnd, 3>& ends) {
  Json proved = Json::array();
  Json reached = Json::array();
  for (const BoxEnd& end : ends) {
    proved.push_back(NumberOrNull(end.proved));
    reached.push_back(end.reached);
  }
  return {{"proved", std::move(proved)}, {"reached", std::move(reached)}};
}

Json BoxesJson(const std::vector<ToleranceBox>& boxes) {
  return ListJson(boxes, [&](const ToleranceBox& box) -> Json {
    Json one = box.is_image
                   ? Json{{"image_id", box.id}, {"image_name", box.name}}
                   : Json{{"point3D_id", box.id}};
    one["position"] = VectorJson(box.position);
    one["is_free"] = box.is_free;
    one["low"] = EndsJson(box.box.low);
    one["high"] = EndsJson(box.box.high);
    return one;
  });
}

Json EndJson(const BoxEnd& end) {
  return {{"proved", NumberOrNull(end.proved)}, {"reached", end.reached}};
}

Json LengthsJson(const std::vector<ToleranceLength>& lengths) {
  return ListJson(lengths, [&](const ToleranceLength& length) -> Json {
    return {{"name", length.name},
            {"metres", NumberOrNull(length.metres)},
            {"tolerance", length.metres ? Json(length.tolerance) : Json()},
            {"is_bar", length.is_bar},
            {"length", FiniteOrNull(length.length)},
            {"is_free", length.is_free},
            {"low", EndJson(length.low)},
            {"high", EndJson(length.high)},
            {"is_contradicted", length.IsContradicted()}};
  });
}

// Six significant digits. A proved end is rounded in the direction `outwards`
// (-1 or 1), so that no more is printed than is proved.
std::string LengthText(std::optional<double> length, int outwards = 0) {
  if (!length) return "-";
  if (outwards != 0 && *length > 0) {
    // Ends that differ by 1e-9 of the last digit are the same.
    const double unit = std::pow(10, std::floor(std::log10(*length)) - 5);
    length = unit * outwards * std::ceil(outwards * *length / unit - 1e-9);
  }
  std::ostringstream text;
  text << std::setprecision(6) << *length;
  return text.str();
}

// The table of the smallest and largest lengths; "" if none was asked for.
std::string LengthTable(const ToleranceSummary& summary) {
  const std::vector<ToleranceLength>& lengths = summary.lengths;
  if (lengths.empty()) return "";
  const auto bar =
      std::find_if(lengths.begin(), lengths.end(),
                   [](const ToleranceLength& length) { return length.is_bar; });
  const bool is_metric = bar != lengths.end();
  std::string text =
      "\nWhat all estimates within " + FormatNumber(summary.max_error, 4) +
      " px, with these rotations, allow distances to be, " +
      (is_metric ? "metres by " + bar->name : std::string("scene units")) +
      "\n";
  TextTable table;
  table.AddRow({"", "at least", "at most", "in the model", "known", "within"});
  std::string contradictions;
  bool has_free = false;
  for (const ToleranceLength& length : lengths) {
    table.AddRow({length.name, LengthText(length.low.proved, -1),
                  LengthText(length.high.proved, 1),
                  FormatLength(length.length), LengthText(length.metres),
                  length.metres ? FormatLength(length.tolerance) : "-"});
    has_free = has_free || !length.low.proved;
    if (!length.IsContradicted() || !is_metric) continue;
    contradictions += "It is proved that " + length.name + " is not " +
                      FormatLength(*length.metres) + " m to within " +
                      FormatLength(length.tolerance) + " m, if " + bar->name +
                      " is what is known of it.\n";
  }
  return text + table.ToString() + contradictions +
         (has_free ? "Where there is no end, -, none was proved: most likely "
                     "nothing holds the distance"
                   : "") +
         (has_free ? (is_metric ? ", or the scale bar.\n" : ".\n") : "");
}

}  // namespace

std::string ToleranceTable(const ToleranceReport& report, int max_rows) {
  const ToleranceSummary& summary = report.summary;
  const std::string end =
      "\n" +
      RunSentence(report.run,
                  "analyzed " + FormatNumber(summary.seconds, 2) + " s (" +
                      Counted(summary.num_programmes, "cone programme") + ")");
  if (summary.boxes.empty()) return LengthTable(summary) + end;
  const std::vector<ToleranceBox> listed =
      Listed(summary.boxes, static_cast<size_t>(max_rows));
  const int decimals = DecimalsFor(listed);
  std::string text =
      "What all estimates within " + FormatNumber(summary.max_error, 4) +
      " px have in common; rotations and intrinsics as given.\n" +
      GaugeSentence(summary) + "\nNo such estimate lies outside (proved)" +
      (listed.size() < summary.boxes.size()
           ? "; the " + std::to_string(listed.size()) + " widest of " +
                 std::to_string(summary.boxes.size()) + ", --csv_path has all"
           : std::string()) +
      "\n";
  TextTable table;
  table.AddRow({"", "x from", "to", "y from", "to", "z from", "to"});
  for (const ToleranceBox& box : listed) {
    std::vector<std::string> row = {
        box.is_image ? box.name : "point " + std::to_string(box.id)};
    for (int axis = 0; axis < 3; ++axis) {
      row.push_back(EndText(box.box.low[axis], decimals));
      row.push_back(EndText(box.box.high[axis], decimals));
    }
    table.AddRow(std::move(row));
  }
  const EndAgreement& agreement = summary.agreement;
  text += table.ToString() + "\n" + Counted(agreement.num_proved, "end") +
          " of " + std::to_string(agreement.num_ends) +
          " proved; estimates that were met reach them to within " +
          FormatNumber(100 * agreement.worst, 1) +
          " % of the way from the model.\n";
  if (agreement.num_proved < agreement.num_ends) {
    text +=
        "Where there is no end, -, none was found, or nothing holds what is "
        "asked for.\n";
  }
  return text + LengthTable(summary) + end;
}

std::string ToleranceJson(const ToleranceReport& report) {
  const ToleranceSummary& summary = report.summary;
  const Json json = {
      {"version", report.run.version},
      {"command", "tolerance_analyzer"},
      {"norm", NormName(summary.norm)},
      {"max_error", summary.max_error},
      {"termination", ToleranceTerminationName(summary.termination)},
      {"largest_error", summary.cost},
      {"is_solved", summary.is_solved},
      {"lower_bound", NumberOrNull(summary.lower_bound)},
      {"gauge",
       {{"images", summary.gauge_images},
        {"num_fixed_frames", summary.num_fixed_frames},
        {"num_fixed_points", summary.num_fixed_points}}},
      {"num_frames", summary.num_frames},
      {"num_points", summary.num_points},
      {"num_observations", summary.num_observations},
      {"num_without_region", summary.num_rowless},
      {"num_far_points", summary.num_far_points},
      {"num_programmes", summary.num_programmes},
      {"contradictions", ContradictionsJson(report.run.contradictions)},
      {"poses", PosesJson(report.run.poses)},
      {"rotations", RotationsJson(report.run.rotations)},
      {"pixel_error",
       {{"before", ErrorJson(report.pixel_error_before)},
        {"after", ErrorJson(report.pixel_error_after)}}},
      {"boxes", BoxesJson(summary.boxes)},
      {"lengths", LengthsJson(summary.lengths)},
      {"agreement",
       {{"num_ends", summary.agreement.num_ends},
        {"num_proved", summary.agreement.num_proved},
        {"worst", summary.agreement.worst}}},
      {"seconds",
       {{"read", report.run.seconds_read},
        {"analysis", summary.seconds},
        {"total", report.run.seconds_total}}},
      {"peak_memory_bytes", report.run.peak_memory_bytes},
      {"threads", report.run.threads},
      {"seed", report.run.seed},
  };
  return ReportText(json);
}

std::string ToleranceCsv(const ToleranceSummary& summary) {
  std::ostringstream csv;
  csv.precision(17);
  csv << "image_id,image_name,point3D_id,axis,position,low_proved,low_reached,"
         "high_reached,high_proved\n";
  for (const ToleranceBox& box : summary.boxes) {
    for (int axis = 0; axis < 3; ++axis) {
      if (box.is_image) {
        csv << box.id << ',' << CsvText(box.name) << ",,";
      } else {
        csv << ",," << box.id << ',';
      }
      const BoxEnd& low = box.box.low[axis];
      const BoxEnd& high = box.box.high[axis];
      csv << kAxes[axis] << ',' << box.position[axis] << ',';
      if (low.proved) csv << *low.proved;
      csv << ',' << low.reached << ',' << high.reached << ',';
      if (high.proved) csv << *high.proved;
      csv << '\n';
    }
  }
  return csv.str();
}

}  // namespace krot::internal
