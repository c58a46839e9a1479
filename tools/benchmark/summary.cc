#include "tools/benchmark/summary.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "tools/benchmark/timing.h"

namespace krot::internal {
namespace {

using Json = nlohmann::ordered_json;

// The rows of a table; empty if the table is missing.
std::vector<Json> Rows(const Reports& reports, const std::string& report,
                       const std::string& table) {
  const auto found = reports.find(report);
  if (found == reports.end()) return {};
  for (const Json& candidate : found->second.at("tables")) {
    if (candidate.at("name") == table) return candidate.at("rows");
  }
  return {};
}

std::optional<double> Number(const Json& row, const std::string& column) {
  const auto found = row.find(column);
  if (found == row.end() || !found->is_number()) return std::nullopt;
  return found->get<double>();
}

std::vector<double> Numbers(const std::vector<Json>& rows,
                            const std::string& column) {
  std::vector<double> numbers;
  for (const Json& row : rows) {
    if (const auto number = Number(row, column)) numbers.push_back(*number);
  }
  return numbers;
}

std::string Text(double value) { return SizedCell(value).text; }

// "55.7 (10.2 to 84.0)": the median and the range.
std::string Spread(std::vector<double> values) {
  if (values.empty()) return "not measured";
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  const std::string range = " (" + Text(*low) + " to " + Text(*high) + ")";
  return Text(MedianOf(std::move(values))) + range;
}

// "tower 0.22, UWO 0.2": the model and the value of a column, for all rows.
std::string List(const std::vector<Json>& rows, const std::string& column) {
  std::string text;
  for (const Json& row : rows) {
    const auto number = Number(row, column);
    if (!number) continue;
    text += (text.empty() ? "" : ", ") + row.at("model").get<std::string>() +
            " " + Text(*number);
  }
  return text.empty() ? "not measured" : text;
}

// For all sizes, the time of the fastest rival that reaches the optimum (by the
// table of ratios), divided by the time of `fast`.
std::vector<double> Leads(const std::vector<Json>& rows) {
  std::vector<double> leads;
  for (const Json& row : rows) {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [column, value] : row.items()) {
      const bool is_rival = column != "cameras" && column != "KROT fast" &&
                            column != "fast, 1e-6" &&
                            column != "side by side" && value.is_number();
      if (is_rival) least = std::min(least, value.get<double>());
    }
    if (std::isfinite(least)) leads.push_back(least);
  }
  return leads;
}

// The rows of one method in the table of growth.
std::vector<Json> Growth(const Reports& reports, const std::string& method) {
  std::vector<Json> rows = Rows(reports, "scaling", "scaling");
  rows.erase(std::remove_if(
                 rows.begin(), rows.end(),
                 [&](const Json& row) { return row.at("method") != method; }),
             rows.end());
  return rows;
}

// The value of a column for the largest model of a method, and its size.
std::string OfLargest(const Reports& reports, const std::string& method,
                      const std::string& column) {
  const std::vector<Json> rows = Growth(reports, method);
  if (rows.empty()) return "not measured";
  const auto number = Number(rows.back(), column);
  if (!number) return "not measured";
  return Text(*number) + " at " +
         std::to_string(rows.back().at("observations").get<int64_t>());
}

std::string GainOfThreads(const std::vector<Json>& sweeps) {
  for (const Json& row : sweeps) {
    for (const auto& [column, value] : row.items()) {
      if (column.rfind("gain of ", 0) == 0) return List(sweeps, column);
    }
  }
  return "not measured";
}

// The ratio of KROT's time to COLMAP's: median and range over the models.
std::string MedianRatio(const std::vector<Json>& rows) {
  return Spread(Numbers(rows, "ratio"));
}

std::string Certified(const std::vector<Json>& rows) {
  if (rows.empty()) return "not measured";
  const auto reached = std::count_if(
      rows.begin(), rows.end(),
      [](const Json& row) { return row.at("gap reached") == "yes"; });
  return std::to_string(reached) + " of " + std::to_string(rows.size());
}

// "Load at the end of each part: blocks 2.1, joint 1.9."
std::vector<std::string> LoadNotes(const Reports& reports) {
  std::string loads;
  for (const auto& [name, report] : reports) {
    const auto machine = report.find("machine");
    if (machine == report.end()) continue;
    loads += (loads.empty() ? "" : ", ") + name + " " +
             RealCell(machine->at("load"), 1).text;
  }
  if (loads.empty()) return {};
  return {"Load at the end of each part: " + loads + "."};
}

}  // namespace

ResultTable Summarize(const Reports& reports) {
  const std::vector<Json> blocks = Rows(reports, "blocks", "blocks");
  const std::vector<Json> sweeps = Rows(reports, "sweep", "sweep");
  const std::vector<Json> races = Rows(reports, "joint", "joint");
  ResultTable table;
  table.name = "summary";
  table.caption = "Medians have their range in brackets";
  table.columns = {"what", "asked", "measured", "command"};
  const auto add = [&](const std::string& what, const std::string& asked,
                       const std::string& measured,
                       const std::string& command) {
    table.rows.push_back({TextCell(what), TextCell(asked), TextCell(measured),
                          TextCell("`" + command + "`")});
  };
  const auto leads = [&](const std::string& report) {
    return Spread(Leads(Rows(reports, report, "figure4_ratio")));
  };
  add("fastest rival's time by `fast`'s, one point, 2 to 200 cameras, p = 2",
      "> 1 everywhere", leads("triangulation"), "triangulation");
  add("the same, p = inf", "> 1 everywhere", leads("triangulation_inf"),
      "triangulation --norm inf");
  add("`paper`'s time by `fast`'s, real sub-problems, points and frames",
      ">= 20", Spread(Numbers(blocks, "ratio")), "blocks");
  add("of those, points", ">= 20", Spread(Numbers(blocks, "Int ratio")),
      "blocks");
  add("of those, frames", ">= 20", Spread(Numbers(blocks, "Res ratio")),
      "blocks");
  add("us per observation and sweep, first ten, one thread", "<= 0.2",
      List(sweeps, "fast"), "sweep");
  add("that by one pass over the residuals", "as near 1 as can be",
      List(sweeps, "fast / floor"), "sweep");
  add("gain of two threads", ">= 1.8", GainOfThreads(sweeps), "sweep");
  add("time per observation and sweep, by that at 10^6", "<= 1.5",
      OfLargest(reports, "res_int", "ratio"), "scaling");
  add("memory of sweeps, MB at most", "<= 25770 (24 GiB)",
      OfLargest(reports, "res_int", "peak (MB)"), "scaling");
  add("bytes per observation beyond the model, sweeps", "<= 200",
      OfLargest(reports, "res_int", "B beyond the model"), "scaling");
  add("bytes per observation beyond the model, joint", "<= 1000",
      OfLargest(reports, "joint", "B beyond the model"), "scaling");
  add("`krot solver`'s time by `colmap bundle_adjuster`'s, real models",
      "median <= 0.1", MedianRatio(races), "joint");
  add("of those, proved to a gap of 1e-4", "all", Certified(races), "joint");
  table.notes = LoadNotes(reports);
  return table;
}

}  // namespace krot::internal
