#include "krot/options/command_options.h"

#include <functional>
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
namespace {

constexpr char kCeres[] = "BundleAdjustmentCeres.";
constexpr char kPlain[] = "BundleAdjustment.";

// Options that COLMAP 4 and COLMAP 3 have in different groups.
const std::vector<std::string> kMoved = {
    "max_num_iterations",
    "max_linear_solver_iterations",
    "function_tolerance",
    "gradient_tolerance",
    "parameter_tolerance",
    "max_num_images_direct_dense_cpu_solver",
    "max_num_images_direct_sparse_cpu_solver"};

void RefuseBoth(const OptionTable& table, const std::string& a,
                const std::string& b) {
  if (!table.IsGiven(a) || !table.IsGiven(b)) return;
  throw OptionError("--" + a + " and --" + b + " are the same; give one");
}

}  // namespace

void AdjustmentOptions::AddTo(OptionTable* table) {
  AddRefined(table);
  AddCap(table);
  AddCeres(table);
  AddWithoutEffect(table);
}

void AdjustmentOptions::AddRefined(OptionTable* table) {
  BundleAdjustmentOptions* options = &adjustment_;
  table->AddBool("BundleAdjustment.refine_focal_length",
                 &options->refine_focal_length, "Focal lengths may move");
  table->AddBool("BundleAdjustment.refine_principal_point",
                 &options->refine_principal_point, "Principal points may move");
  table->AddBool("BundleAdjustment.refine_extra_params",
                 &options->refine_extra_params,
                 "Distortion parameters may move");
  table->AddBool("BundleAdjustment.refine_rig_from_world",
                 &options->refine_rig_from_world,
                 "Frames may move; in a model without rigs, images");
  table->AddBool("BundleAdjustment.refine_sensor_from_rig",
                 &options->refine_sensor_from_rig,
                 "The sensors of a rig may move in it");
  table->AddBool("BundleAdjustment.refine_extrinsics", &refine_extrinsics_,
                 "COLMAP 3.8's name for the last two together");
  table->AddBool("BundleAdjustment.refine_points3D", &options->refine_points3D,
                 "Points may move");
  table->AddBool("BundleAdjustment.constant_rig_from_world_rotation",
                 &options->constant_rig_from_world_rotation,
                 "Frames that may move keep their rotations");
  table->AddInteger("BundleAdjustment.min_track_length",
                    &options->min_track_length, AtLeast(1, "observations"),
                    "Leave out points with fewer usable observations; they "
                    "stay in the model");
  table->AddNamed<AdjustmentDatum>(
      "BundleAdjustment.datum", &datum_,
      {{"CAMERAS", AdjustmentDatum::kCameras},
       {"POINTS", AdjustmentDatum::kPoints},
       {"FIRST_CAMERA", AdjustmentDatum::kFirstCamera}},
      "What the report's standard deviations refer to where nothing is fixed: "
      "the cameras' mean place, turn and extent; inner constraints over the "
      "points; or the first camera and its longest base");
}

void AdjustmentOptions::AddCap(OptionTable* table) {
  table->Add({"BundleAdjustment.max_error",
              "Keep every error below this; minimum: first lower the largest "
              "error over all that moves, to a local minimum",
              "a number > 0, pixels, or minimum", "", false,
              [this](const std::string& text) {
                adjustment_.lower_max_error = text == "minimum";
                return adjustment_.lower_max_error ||
                       (ParseReal(text, &max_error_) && max_error_ > 0);
              }});
  table->Add({"BundleAdjustment.max_error_factor",
              "The same, as a multiple of the lowest maximum of krot solver",
              "a number > 1", "", false, [this](const std::string& text) {
                return ParseReal(text, &max_error_factor_) &&
                       max_error_factor_ > 1;
              }});
}

void AdjustmentOptions::AddCeres(OptionTable* table) {
  BundleAdjustmentOptions* options = &adjustment_;
  for (const std::string group : {kCeres, kPlain}) {
    const auto text = [&](size_t k, const std::string& meaning) {
      return group == kCeres ? meaning
                             : "COLMAP 3's name of " + (kCeres + kMoved[k]);
    };
    table->AddInteger(group + kMoved[0], &options->max_num_iterations,
                      AtLeast(0), text(0, "The most iterations"));
    table->AddInteger(
        group + kMoved[1], &options->max_linear_solver_iterations, AtLeast(1),
        text(1, "The most iterations of conjugate gradients in each"));
    table->AddReal(
        group + kMoved[2], &options->function_tolerance, AtLeast(0.0),
        text(2, "Stop when the cost changes by less, relative to it"));
    table->AddReal(group + kMoved[3], &options->gradient_tolerance,
                   AtLeast(0.0),
                   text(3, "Stop when no entry of the gradient is larger"));
    table->AddReal(
        group + kMoved[4], &options->parameter_tolerance, AtLeast(0.0),
        text(4, "Stop when the parameters change by less, relative to them"));
    table->AddInteger(
        group + kMoved[5], &options->max_num_images_direct_dense, AtLeast(0),
        text(5, "Up to so many images the reduced camera system is dense"));
    table->AddInteger(
        group + kMoved[6], &options->max_num_images_direct_sparse, AtLeast(0),
        text(6,
             "Up to so many images it is sparse, or dense where its factor is "
             "nearly full; beyond, and where that takes longer, conjugate "
             "gradients solve it"));
  }
  table->AddNamed<RobustLoss>("BundleAdjustmentCeres.loss_function_type",
                              &options->loss,
                              {{"TRIVIAL", RobustLoss::kTrivial},
                               {"SOFT_L1", RobustLoss::kSoftL1},
                               {"CAUCHY", RobustLoss::kCauchy},
                               {"HUBER", RobustLoss::kHuber}},
                              "How large errors are weighed");
  table->AddReal("BundleAdjustmentCeres.loss_function_scale",
                 &options->loss_scale, Above(0.0, "pixels"),
                 "The error above which a loss other than TRIVIAL weighs "
                 "less");
  table->AddThreads("BundleAdjustmentCeres.num_threads", &num_threads_,
                    "without a cap the last digits differ from run to run with "
                    "more than one");
}

// Accepts options that say where COLMAP computes; KROT always computes on the
// CPU, and adjusts with Ceres.
void AdjustmentOptions::AddWithoutEffect(OptionTable* table) {
  const auto add = [&](const std::string& name, const std::string& range,
                       const std::function<bool(const std::string&)>& parse) {
    table->Add({name, "", range, "", false, parse, false, {}, true});
  };
  add("BundleAdjustment.backend", "CERES: KROT adjusts with no other solver",
      [](const std::string& text) { return IsSameWord(text, "CERES"); });
  for (const std::string group : {kCeres, kPlain}) {
    add(group + "use_gpu", "0: KROT adjusts on the CPU alone",
        [](const std::string& text) {
          bool use_gpu = true;
          return ParseBool(text, &use_gpu) && !use_gpu;
        });
    for (const char* name : {"gpu_index", "min_num_images_gpu_solver",
                             "min_num_residuals_for_cpu_multi_threading",
                             "max_num_images_direct_dense_gpu_solver",
                             "max_num_images_direct_sparse_gpu_solver"}) {
      add(group + name, "", [](const std::string&) { return true; });
    }
  }
}

AdjustModelOptions AdjustmentOptions::Resolve(const OptionTable& table) const {
  for (const std::string& name : kMoved) {
    RefuseBoth(table, kCeres + name, kPlain + name);
  }
  for (const char* name : {"BundleAdjustment.refine_rig_from_world",
                           "BundleAdjustment.refine_sensor_from_rig"}) {
    RefuseBoth(table, "BundleAdjustment.refine_extrinsics", name);
  }
  RefuseBoth(table, "BundleAdjustment.max_error",
             "BundleAdjustment.max_error_factor");

  AdjustModelOptions options;
  options.datum = datum_;
  options.adjustment = adjustment_;
  BundleAdjustmentOptions& adjustment = options.adjustment;
  if (!refine_extrinsics_) {
    adjustment.refine_rig_from_world = false;
    adjustment.refine_sensor_from_rig = false;
  }
  if (!adjustment.refine_rig_from_world) {
    table.Refuse("BundleAdjustment.constant_rig_from_world_rotation",
                 "where frames may not move");
  }
  const bool is_trivial = adjustment.loss == RobustLoss::kTrivial;
  if (is_trivial) {
    table.Refuse("BundleAdjustmentCeres.loss_function_scale",
                 "without --BundleAdjustmentCeres.loss_function_type");
  }
  const bool has_cap = table.IsGiven("BundleAdjustment.max_error");
  const bool has_factor = table.IsGiven("BundleAdjustment.max_error_factor");
  if ((has_cap || has_factor) && !is_trivial) {
    throw OptionError(
        "--BundleAdjustment.max_error and max_error_factor need "
        "--BundleAdjustmentCeres.loss_function_type TRIVIAL");
  }
  if (has_cap && !adjustment.lower_max_error) {
    adjustment.max_error = max_error_;
  }
  if (has_factor) options.max_error_factor = max_error_factor_;
  return options;
}

void AddOutlierFilterOptions(OutlierFilterOptions* options, Context* context,
                             OptionTable* table) {
  AddPixels("OutlierFilter.max_error",
            "The bound for all errors; without it, what noise does not explain "
            "is removed",
            "", &options->max_error, table);
  table->AddNamed<OutlierMethod>(
      "OutlierFilter.method", &options->method,
      {{"conflicts", OutlierMethod::kConflicts},
       {"snooping", OutlierMethod::kSnooping}},
      "conflicts: remove few for the bound; snooping, the default without "
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
    options->find_conflicts = false;
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
  const std::vector<int32_t>& held = options.gauge_images;
  if (!held.empty() && (held.size() != 2 || held[0] == held[1])) {
    Refuse("gauge_images", arguments.gauge_images, "two images that differ");
  }
  if (options.images.empty() && options.points.empty()) {
    options.images.resize(model.images.size());
    std::iota(options.images.begin(), options.images.end(), 0);
  }
  return options;
}

}  // namespace krot::internal
