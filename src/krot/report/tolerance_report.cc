#include "krot/report/reports.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
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

// The length of the box's longest side; infinite if an end is not proved.
double Width(const ToleranceBox& box) {
  double width = 0;
  for (int axis = 0; axis < 3; ++axis) {
    width = std::max(width, box.box.high[axis].proved.value_or(kInfinity) -
                                box.box.low[axis].proved.value_or(-kInfinity));
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
  return {
      {"proved", ListJson(ends, [](const BoxEnd& end) { return end.proved; })},
      {"reached",
       ListJson(ends, [](const BoxEnd& end) { return end.reached; })}};
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

Json EndJson(const BoxEnd& end) { return KROT_JSON_OF(end, proved, reached); }

Json LengthJson(const ToleranceLength& length) {
  Json json = KROT_JSON_OF(length, name, metres);
  json.update(
      KnownIf(length.metres.has_value(), KROT_JSON_OF(length, tolerance)));
  json.update(KROT_JSON_OF(length, is_bar, length, is_free));
  json["low"] = EndJson(length.low);
  json["high"] = EndJson(length.high);
  json["is_contradicted"] = length.IsContradicted();
  return json;
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
      "\nWhat all estimates within " + Pixels(summary.max_error) +
      ", with these rotations, allow distances to be, " +
      (is_metric ? "metres by " + bar->name : std::string("scene units")) +
      "\n";
  TextTable table(
      {"", "at least", "at most", "in the model", "known", "within"});
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
         TextIf(has_free,
                "Where there is no end, -, none was proved: most likely "
                "nothing holds the distance" +
                    TextIf(is_metric, ", or the scale bar") + ".\n");
}

}  // namespace

std::string ToleranceTable(const ToleranceReport& report, int max_rows) {
  const ToleranceSummary& summary = report.summary;
  const std::string end =
      "\n" +
      RunSentence(report.run,
                  "analyzed " + Seconds(summary.seconds) + " (" +
                      Counted(summary.num_programmes, "cone programme") + ")");
  if (summary.boxes.empty()) return LengthTable(summary) + end;
  const std::vector<ToleranceBox> listed =
      Listed(summary.boxes, static_cast<size_t>(max_rows));
  const int decimals = DecimalsFor(listed);
  std::string text =
      "What all estimates within " + Pixels(summary.max_error) +
      " have in common; rotations and intrinsics as given.\n" +
      GaugeSentence(summary) + "\nNo such estimate lies outside (proved)" +
      TextIf(listed.size() < summary.boxes.size(),
             "; the " + std::to_string(listed.size()) + " widest of " +
                 std::to_string(summary.boxes.size()) +
                 ", --csv_path has all") +
      "\n";
  TextTable table({"", "x from", "to", "y from", "to", "z from", "to"});
  for (const ToleranceBox& box : listed) {
    Row row = {box.is_image ? box.name : "point " + std::to_string(box.id)};
    for (int axis = 0; axis < 3; ++axis) {
      row.push_back(FormatNumber(box.box.low[axis].proved, decimals));
      row.push_back(FormatNumber(box.box.high[axis].proved, decimals));
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
  Json json = {{"version", report.run.version},
               {"command", "tolerance_analyzer"},
               {"norm", NormName(summary.norm)},
               {"max_error", summary.max_error},
               {"termination", ToleranceTerminationName(summary.termination)},
               {"largest_error", summary.cost}};
  json.update(KROT_JSON_OF(summary, is_solved, lower_bound));
  json["gauge"] =
      Joined({{"images", summary.gauge_images}},
             KROT_JSON_OF(summary, num_fixed_frames, num_fixed_points));
  json.update(KROT_JSON_OF(summary, num_frames, num_points, num_observations));
  json["num_without_region"] = summary.num_rowless;
  json.update(KROT_JSON_OF(summary, num_far_points, num_programmes));
  json["contradictions"] = ContradictionsJson(report.run.contradictions);
  json["poses"] = PosesJson(report.run.poses);
  json["rotations"] = JsonIf(report.run.rotations, RotationsJson);
  json["pixel_error"] =
      BeforeAfterJson(report.pixel_error_before, report.pixel_error_after);
  json["boxes"] = BoxesJson(summary.boxes);
  json["lengths"] = ListJson(summary.lengths, LengthJson);
  json["agreement"] =
      KROT_JSON_OF(summary.agreement, num_ends, num_proved, worst);
  json["seconds"] = {{"read", report.run.seconds_read},
                     {"analysis", summary.seconds},
                     {"total", report.run.seconds_total}};
  json.update(KROT_JSON_OF(report.run, peak_memory_bytes, threads, seed));
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
