#include <filesystem>
#include <string>
#include <vector>

#include "krot/camera/camera_model.h"
#include "krot/database.h"
#include "krot/report/text_table.h"
#include "krot/synthetic/scene.h"
#include "tools/krot/command.h"
#include "tools/krot/common_options.h"
#include "tools/krot/interrupt.h"
#include "tools/krot/model_files.h"
#include "tools/krot/same_path.h"

namespace krot::internal {
namespace {

struct SynthesizerOptions {
  std::string output_path;
  std::string ground_truth_path;
  std::string database_path;
  std::string output_type = "BIN";
  bool overwrite = false;
  std::string layout = "orbit";
  std::string camera_model = "SIMPLE_RADIAL";
  SceneOptions scene;
  CommonOptions common;
};

std::vector<std::string> CameraModelNames() {
  std::vector<std::string> names;
  for (const CameraModelInfo& info : CameraModels()) {
    names.emplace_back(info.name);
  }
  return names;
}

void AddContents(SynthesizerOptions* options, OptionParser* parser) {
  SceneOptions* scene = &options->scene;
  parser->AddChoice("Scene.layout", &options->layout, {"orbit", "street"},
                    "Frames around a cloud of points, or along a path");
  parser->AddInteger("Scene.num_frames", &scene->num_frames,
                     Between(2, 10000000), "Frames");
  parser->AddInteger("Scene.num_points", &scene->num_points,
                     Between(1, 1000000000), "Points");
  parser->AddReal(
      "Scene.track_length", &scene->track_length,
      AtLeast(2.0, "at most the number of images"),
      "Mean number of images that see a point, where enough have it in view");
  parser->AddChoice("Scene.camera_model", &options->camera_model,
                    CameraModelNames(), "The model of every camera");
  parser->AddInteger("Scene.image_width", &scene->image_width,
                     Between(64, 65536, "pixels"), "Width of every image");
  parser->AddInteger("Scene.image_height", &scene->image_height,
                     Between(64, 65536, "pixels"), "Height of every image");
  parser->AddReal(
      "Scene.focal_length_factor", &scene->focal_length_factor,
      Between(0.5, 10.0),
      "Focal length by the larger side of the image; a panorama has "
      "none");
  parser->AddBool("Scene.has_rigs", &scene->has_rigs,
                  "Write rigs and frames; without, as COLMAP 3.8 to 3.11 do");
  parser->AddInteger("Scene.sensors_per_rig", &scene->sensors_per_rig,
                     Between(1, 16), "Cameras in the rig");
  parser->AddReal("Scene.rig_baseline", &scene->rig_baseline,
                  Between(0.0, 0.2, "viewing distances"),
                  "Distance of every camera of the rig from its first");
  parser->AddReal("Scene.rig_rotation_deg", &scene->rig_rotation_deg,
                  Between(0.0, 180.0, "degrees"),
                  "Yaw between neighbouring cameras of the rig");
}

void AddImperfections(SceneOptions* scene, OptionParser* parser) {
  parser->AddReal("Scene.pixel_noise", &scene->pixel_noise,
                  Between(0.0, 10.0, "pixels"),
                  "Standard deviation of the observations, per axis");
  parser->AddReal("Scene.outlier_ratio", &scene->outlier_ratio,
                  Between(0.0, 0.9),
                  "Share of the observations that move to a random pixel");
  parser->AddReal("Scene.duplicate_ratio", &scene->duplicate_ratio,
                  Between(0.0, 1.0),
                  "Share of the observations that have a twin in their image");
  parser->AddReal("Scene.start_translation_noise",
                  &scene->start_translation_noise,
                  Between(0.0, 1.0, "viewing distances"),
                  "Standard deviation of the frames' centres in the model to "
                  "solve, per axis");
  parser->AddReal("Scene.start_point_noise", &scene->start_point_noise,
                  Between(0.0, 1.0, "viewing distances"),
                  "Standard deviation of the points in the model to solve, "
                  "per axis");
  parser->AddReal("Scene.rotation_noise_deg", &scene->rotation_noise_deg,
                  Between(0.0, 3.0, "degrees"),
                  "Standard deviation of the rotations in the model to solve");
}

void AddSynthesizerOptions(SynthesizerOptions* options, OptionParser* parser) {
  parser->AddPath("output_path", &options->output_path, true, "a folder",
                  "Where the model to solve goes");
  parser->AddPath("ground_truth_path", &options->ground_truth_path, false,
                  "a folder",
                  "Where the same model with exact poses and points goes");
  parser->AddOutputFile(
      "database_path", &options->database_path,
      "Where a database goes with the model's tracks as matches");
  parser->AddChoice("output_type", &options->output_type, {"BIN", "TXT"},
                    "The format to write");
  AddOverwrite(&options->overwrite, parser);
  AddContents(options, parser);
  AddImperfections(&options->scene, parser);
  AddCommonOptions(&options->common, parser,
                   "Equal seeds and options give equal models");
}

SceneOptions ToSceneOptions(const SynthesizerOptions& options) {
  SceneOptions scene = options.scene;
  scene.layout =
      options.layout == "orbit" ? SceneLayout::kOrbit : SceneLayout::kStreet;
  scene.camera_model_id = FindCameraModel(options.camera_model)->id;
  scene.random_seed = options.common.random_seed;
  if (IsSamePath(options.ground_truth_path, options.output_path)) {
    throw OptionError("--ground_truth_path is --output_path");
  }
  if (!scene.has_rigs && scene.sensors_per_rig > 1) {
    throw OptionError(
        "--Scene.sensors_per_rig above 1 needs --Scene.has_rigs 1");
  }
  const double num_images =
      static_cast<double>(scene.num_frames) * scene.sensors_per_rig;
  if (scene.track_length > num_images) {
    throw OptionError(
        "--Scene.track_length = " + NumberText(scene.track_length) +
        ", must be at most the number of images, " + NumberText(num_images));
  }
  return scene;
}

// Refuses what the options' ranges cannot tell: sensors turned too far apart to
// see a point in common.
SyntheticScene Synthesize(const SceneOptions& options) {
  try {
    return SynthesizeScene(options);
  } catch (const std::invalid_argument& error) {
    throw OptionError(error.what());
  }
}

std::string SceneTable(const SyntheticScene& scene) {
  const auto count = [](size_t size) { return std::to_string(size); };
  TextTable table;
  table.AddRow({"cameras", count(scene.model.cameras.size())});
  table.AddRow(
      {"frames",
       count(scene.model.stores_rigs ? scene.model.frames.size() : 0)});
  table.AddRow({"images", count(scene.model.images.size())});
  table.AddRow({"points", count(scene.model.points3D.size())});
  table.AddRow({"observations", count(scene.model.track_elements.size())});
  table.AddRow({"outliers", count(scene.outliers.size())});
  return "Synthetic model\n" + table.ToString();
}

}  // namespace

int RunModelSynthesizer(const std::vector<std::string>& arguments) {
  SynthesizerOptions options;
  OptionParser parser("model_synthesizer",
                      "makes a COLMAP model with known ground truth");
  AddSynthesizerOptions(&options, &parser);
  if (!ParseOrPrintHelp(arguments, options.common.log, &parser))
    return kExitDone;
  const SceneOptions scene_options = ToSceneOptions(options);
  WriteModelOptions write_options;
  write_options.format =
      options.output_type == "TXT" ? ModelFormat::kText : ModelFormat::kBinary;
  write_options.overwrite = options.overwrite;
  write_options.on_note = WarnOn(options.common.log);
  CheckWritable(options.output_path, write_options);
  const bool wants_ground_truth = !options.ground_truth_path.empty();
  if (wants_ground_truth) {
    CheckWritable(options.ground_truth_path, write_options);
  }
  CheckSidePath("database_path", options.database_path);
  if (std::filesystem::exists(options.database_path) && !options.overwrite) {
    throw WriteError(options.database_path +
                     ": is there already; set overwrite to replace it");
  }

  const SyntheticScene scene = Synthesize(scene_options);
  DeferInterrupts();
  WriteModel(scene.model, options.output_path, write_options);
  if (wants_ground_truth) {
    WriteModel(scene.ground_truth, options.ground_truth_path, write_options);
  }
  if (!options.database_path.empty()) {
    WriteDatabase(options.database_path, scene.ground_truth,
                  DatabaseOf(scene.ground_truth));
  }
  PrintTable(options.common.log, SceneTable(scene));
  return kExitDone;
}

}  // namespace krot::internal
