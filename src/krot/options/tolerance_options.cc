#include "krot/options/command_options.h"

#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "krot/model/rigs.h"
#include "krot/options/option_table.h"

namespace krot::internal {

void AddOutlierFilterOptions(OutlierFilterOptions* options, Context* context,
                             OptionTable* table) {
  AddPixels("OutlierFilter.max_error",
            "The bound for all errors; without it, what noise does not explain "
            "is removed",
            "", &options->max_error, table);
  table->AddNamed<OutlierMethod>(
      "OutlierFilter.method", &options->method,
      {{"conflicts", OutlierMethod::kConflicts},
       {"threshold", OutlierMethod::kThreshold},
       {"snooping", OutlierMethod::kSnooping}},
      "conflicts: remove few for the bound; threshold: remove what is above "
      "it, solve, and repeat, for comparison; snooping, the default without "
      "max_error and profile_path: remove what noise does not explain");
  AddFinishLoss(&options->solve, table);
  table->AddReal("Solver.relative_gap", &options->solve.joint.relative_gap,
                 Above(0.0),
                 "How far the largest error of what is left may be above the "
                 "proved bound, relative to it");
  AddSameImage(&options->solve.problem, table);
  table->AddThreads("Solver.num_threads", &context->num_threads,
                    "the result is the same, bit by bit");
}

void ResolveOutlierFilterOptions(const OptionTable& table, bool makes_profile,
                                 OutlierFilterOptions* options) {
  if (!options->max_error && !makes_profile &&
      !table.IsGiven("OutlierFilter.method")) {
    options->method = OutlierMethod::kSnooping;
  }
  if (options->method == OutlierMethod::kSnooping) {
    table.RefuseAll({"OutlierFilter.max_error", "Solver.relative_gap",
                     "Problem.same_image"},
                    "with --OutlierFilter.method snooping");
  }
  if (options->method == OutlierMethod::kThreshold && !options->max_error) {
    throw OptionError(
        "--OutlierFilter.max_error is required with --OutlierFilter.method "
        "threshold");
  }
  CheckFinishLoss(options->solve, table);
}

namespace {

std::vector<std::string> SplitAtCommas(const std::string& list) {
  std::vector<std::string> names;
  std::istringstream stream(list);
  for (std::string name; std::getline(stream, name, ',');) {
    if (!name.empty()) names.push_back(name);
  }
  return names;
}

[[noreturn]] void Refuse(const std::string& option, const std::string& name,
                         const std::string& expected) {
  throw OptionError("--ToleranceAnalyzer." + option + " names " + name +
                    ", must name " + expected);
}

std::vector<int32_t> FindImages(const std::string& option,
                                const std::string& list, const Model& model) {
  std::multimap<std::string, int32_t> by_name;
  for (size_t i = 0; i < model.images.size(); ++i) {
    by_name.emplace(model.images[i].name, static_cast<int32_t>(i));
  }
  const IdIndex<ImageId> by_id(model.images);
  std::vector<int32_t> found;
  for (const std::string& name : SplitAtCommas(list)) {
    const auto named = by_name.find(name);
    uint64_t id = 0;
    std::optional<int32_t> image;
    if (named != by_name.end()) {
      image = named->second;
    } else if (ParseInteger(name, &id) &&
               id <= std::numeric_limits<ImageId>::max()) {
      image = by_id.Find(static_cast<ImageId>(id));
    }
    if (!image) Refuse(option, name, "images of the model, by name or id");
    if (by_name.count(name) > 1) {
      Refuse(option, name + ", which several images bear", "one, by its id");
    }
    found.push_back(*image);
  }
  return found;
}

std::vector<int32_t> FindPoints(const std::string& list, const Model& model) {
  const IdIndex<Point3DId> by_id(model.points3D);
  std::vector<int32_t> found;
  for (const std::string& text : SplitAtCommas(list)) {
    uint64_t id = 0;
    const std::optional<int32_t> point =
        ParseInteger(text, &id) ? by_id.Find(id) : std::nullopt;
    if (!point) Refuse("points", text, "3D points of the model, by id");
    found.push_back(*point);
  }
  return found;
}

void AddList(const std::string& name, std::string* list,
             const std::string& description, const std::string& range,
             const std::string& default_text, OptionTable* table) {
  table->Add({name, description, range, default_text, false,
              [list](const std::string& text) {
                *list = text;
                return !SplitAtCommas(text).empty();
              }});
}

}  // namespace

void AddToleranceOptions(ToleranceArguments* arguments, Context* context,
                         OptionTable* table) {
  ToleranceOptions* options = &arguments->options;
  table->Add(
      {"ToleranceAnalyzer.max_error",
       "The bound: all estimates count whose errors are within it",
       "a number > 0, pixels", "", true, [options](const std::string& text) {
         return ParseReal(text, &options->max_error) && options->max_error > 0;
       }});
  AddList("ToleranceAnalyzer.images", &arguments->images,
          "The images whose centres are asked for, by name or id",
          "a list with commas", "all, unless points are named", table);
  AddList("ToleranceAnalyzer.points", &arguments->points,
          "The 3D points that are asked for, by id", "a list with commas",
          "none", table);
  AddList("ToleranceAnalyzer.gauge_images", &arguments->gauge_images,
          "What holds place and scale unless something is fixed: the first "
          "image stands still, the second keeps its distance along the line "
          "between the two",
          "two images, with a comma",
          "the one with the most observations and the one farthest from it",
          table);
  table->AddReal("ToleranceAnalyzer.tolerance", &options->tolerance,
                 Above(0.0, "relative to how far an end is away"),
                 "How far a proved end may be beyond a reached one");
  table->AddNamed<double>("Solver.norm", &options->solve.norm.p,
                          {{"1", 1}, {"2", 2}, {"inf", Norm::LInf().p}},
                          "The p of the errors' norm");
  table->AddThreads("Solver.num_threads", &context->num_threads,
                    "the result is the same, bit by bit");
  table->AddInteger("Problem.min_track_length",
                    &options->solve.problem.min_track_length,
                    AtLeast(1, "observations"),
                    "Leave out points with fewer usable observations");
  AddSameImage(&options->solve.problem, table);
}

ToleranceOptions ResolveToleranceOptions(const ToleranceArguments& arguments,
                                         const Model& model) {
  ToleranceOptions options = arguments.options;
  options.images = FindImages("images", arguments.images, model);
  options.points = FindPoints(arguments.points, model);
  options.gauge_images =
      FindImages("gauge_images", arguments.gauge_images, model);
  if (!options.gauge_images.empty() && options.gauge_images.size() != 2) {
    Refuse("gauge_images", arguments.gauge_images, "two images");
  }
  if (options.images.empty() && options.points.empty()) {
    options.images.resize(model.images.size());
    std::iota(options.images.begin(), options.images.end(), 0);
  }
  return options;
}

}  // namespace krot::internal
