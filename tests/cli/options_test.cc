#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

// Every option: a value it takes, one it does not take, and the pairs that
// contradict each other.

namespace krot::internal {
namespace {

class Options : public ::testing::Test {
 protected:
  Options() { Save(SmallLegacyModel(), folder_ / "input"); }

  Words Paths() const {
    return {"--input_path", folder_ / "input", "--output_path",
            folder_ / "output"};
  }

  KrotResult Solve(const Words& more) const {
    return RunKrot(Words{"solver"} + Paths() + more);
  }

  // No option that is refused may have changed anything.
  void ExpectRefused(const std::string& command, const Words& arguments,
                     const std::string& part) const {
    const Words before = FileNames(folder_.path());
    EXPECT_THAT(RunKrot(Words{command} + arguments),
                IsRefused(1, "krot " + command, part));
    EXPECT_EQ(FileNames(folder_.path()), before);
  }

  TempFolder folder_;
};

TEST_F(Options, OfTheSolverAreCheckedAgainstTheirRanges) {
  const std::vector<Words> wrong = {
      {"--Solver.method", "fast", "one of {auto, res_int, joint}"},
      {"--Solver.init", "zero", "one of {model, feasible}"},
      {"--Solver.relative_gap", "0", "a number > 0"},
      {"--Problem.init_max_error", "0", "a number > 0, pixels"},
      {"--Joint.max_iterations", "0", "an integer >= 1"},
      {"--Solver.norm", "0.5", "1, 2, inf or a number >= 1"},
      {"--Solver.norm", "nan", "1, 2, inf or a number >= 1"},
      {"--Solver.norm", "two", "1, 2, inf or a number >= 1"},
      {"--Solver.num_threads", "0", "-1 or an integer in [1, 1024]"},
      {"--Solver.num_threads", "1.5", "-1 or an integer in [1, 1024]"},
      {"--Solver.settings", "slow", "one of {fast, paper}"},
      {"--ResInt.max_sweeps", "-1", "an integer >= 0"},
      {"--ResInt.max_sweeps", "9999999999", "an integer >= 0"},
      {"--ResInt.sweep_tolerance", "-1e-3", "a number >= 0"},
      {"--ResInt.sweep_tolerance", "inf", "a number >= 0"},
      {"--FastDescent.stationarity_tolerance", "-1", "a number >= 0"},
      {"--FastDescent.step_tolerance", "0", "a number > 0"},
      {"--FastDescent.slope_probe", "0", "a number > 0"},
      {"--FastDescent.active_tolerance", "1", "a number in [0, 1)"},
      {"--FastDescent.max_step", "0", "a number > 0"},
      {"--FastDescent.max_iterations", "0", "an integer >= 1"},
      {"--Problem.min_track_length", "0", "an integer >= 1"},
      {"--output_type", "PLY", "one of {auto, BIN, TXT}"},
      {"--overwrite", "yes", "{0, 1}"},
      {"--random_seed", "-1", "an integer >= 0"},
      {"--log_level", "3", "an integer in [0, 2]"},
      {"--log_to_stderr", "2", "{0, 1}"},
      {"--project_path", "nowhere.ini", "a file that can be read"},
  };
  for (const Words& option : wrong) {
    SCOPED_TRACE(option[0] + " " + option[1]);
    ExpectRefused("solver", Paths() + Words{option[0], option[1]},
                  option[0] + " = " + option[1] + ", must be " + option[2]);
  }
}

TEST_F(Options, OfTheSynthesizerAreCheckedAgainstTheirRanges) {
  const std::vector<Words> wrong = {
      {"--Scene.layout", "spiral"},
      {"--Scene.num_frames", "1"},
      {"--Scene.num_points", "0"},
      {"--Scene.track_length", "1.9"},
      {"--Scene.camera_model", "PANORAMA"},
      {"--Scene.image_width", "63"},
      {"--Scene.image_height", "70000"},
      {"--Scene.focal_length_factor", "0.1"},
      {"--Scene.has_rigs", "maybe"},
      {"--Scene.sensors_per_rig", "0"},
      {"--Scene.rig_baseline", "-0.1"},
      {"--Scene.rig_rotation_deg", "200"},
      {"--Scene.pixel_noise", "-1"},
      {"--Scene.outlier_ratio", "1"},
      {"--Scene.duplicate_ratio", "2"},
      {"--Scene.start_translation_noise", "2"},
      {"--Scene.start_point_noise", "-1"},
      {"--Scene.rotation_noise_deg", "4"},
      {"--output_type", "auto"},
  };
  for (const Words& option : wrong) {
    SCOPED_TRACE(option[0] + " " + option[1]);
    ExpectRefused("model_synthesizer",
                  Words{"--output_path", folder_ / "scene"} + option,
                  option[0] + " = " + option[1] + ", must be ");
  }
}

TEST_F(Options, ThatContradictEachOtherAreRefused) {
  for (const char* name : {"stationarity_tolerance", "step_tolerance",
                           "slope_probe", "active_tolerance", "max_step"}) {
    const std::string option = std::string("--FastDescent.") + name;
    for (const char* command : {"solver", "point_triangulator"}) {
      ExpectRefused(command, Paths() + Words{option, "0.5"},
                    option + " has no effect with --Solver.settings fast");
    }
  }
  ExpectRefused("solver",
                Paths() + Words{"--Solver.finish", "none",
                                "--Solver.finish_slack", "0.1"},
                "--Solver.finish_slack has no effect without --Solver.finish "
                "least_squares");
  ExpectRefused("solver", Paths() + Words{"--Solver.finish_loss_scale", "2"},
                "has no effect without --Solver.finish_loss huber or cauchy");
  ExpectRefused(
      "solver",
      Paths() + Words{"--Solver.method", "joint", "--Solver.finish", "none"},
      "--Solver.finish has no effect but with --Solver.method auto");
  ExpectRefused("solver",
                {"--input_path", folder_ / "input", "--output_path",
                 folder_ / "input/../input/"},
                "--output_path is --input_path; add --overwrite 1");
  ExpectRefused("solver",
                Paths() + Words{"--report_path", folder_ / "output/images.bin"},
                "must not bear the name of a model's file");
  ExpectRefused("model_analyzer",
                {"--path", folder_ / "input", "--input_path", "elsewhere"},
                "--path and --input_path are the same; give one");
  ExpectRefused(
      "model_synthesizer",
      {"--output_path", folder_ / "a", "--ground_truth_path", folder_ / "a/"},
      "--ground_truth_path is --output_path");
  ExpectRefused("model_synthesizer",
                {"--output_path", folder_ / "a", "--Scene.has_rigs", "0",
                 "--Scene.sensors_per_rig", "2"},
                "needs --Scene.has_rigs 1");
  ExpectRefused("model_synthesizer",
                {"--output_path", folder_ / "a", "--Scene.num_frames", "3",
                 "--Scene.track_length", "4"},
                "must be at most the number of images, 3");
}

// All outputs of all commands, and what else they read, by whatever way the
// file is named.
TEST_F(Options, ThatNameOneFileTwiceAreRefused) {
  std::filesystem::create_directory_symlink(folder_.path(), folder_ / "link");
  const std::string file = folder_ / "file";
  WriteBytes(file, "");
  const Words twins = {file, folder_ / "input/../file", folder_ / "link/file"};
  const Words missing_twins = {folder_ / "new", folder_ / "./new",
                               folder_ / "link/new"};
  const Words model = {"--path", folder_ / "input"};
  const Words models = {"--input_path1", folder_ / "input", "--input_path2",
                        folder_ / "input"};
  const std::vector<std::pair<std::string, Words>> commands = {
      {"solver", Paths()},
      {"point_triangulator", Paths()},
      {"bundle_adjuster", Paths()},
      {"model_analyzer", model},
      {"model_comparer", models}};
  const std::vector<Words> pairs = {
      {"solver", "--report_path", "--html_path"},
      {"solver", "--report_path", "--certificate_path"},
      {"solver", "--html_path", "--certificate_path"},
      {"solver", "--report_path", "--project_path"},
      {"point_triangulator", "--report_path", "--html_path"},
      {"bundle_adjuster", "--report_path", "--html_path"},
      {"model_analyzer", "--report_path", "--certificate_path"},
      {"model_analyzer", "--report_path", "--error_colors_path"},
      {"model_comparer", "--report_path", "--html_path"},
      {"model_comparer", "--html_path", "--certificate_path1"},
      {"model_comparer", "--report_path", "--certificate_path2"},
      {"model_comparer", "--report_path", "--output_path"},
      {"model_comparer", "--html_path", "--overlay_path"}};
  for (const Words& pair : pairs) {
    SCOPED_TRACE(pair[0] + " " + pair[1] + " " + pair[2]);
    const auto paths =
        std::find_if(commands.begin(), commands.end(),
                     [&](const auto& c) { return c.first == pair[0]; });
    for (const Words& names : {twins, missing_twins}) {
      if (pair[2] == "--project_path" && names == missing_twins) continue;
      for (const std::string& name : names) {
        ExpectRefused(pair[0],
                      paths->second + Words{pair[1], name, pair[2], names[0]},
                      pair[1] + " = " + name + ", must not be " + pair[2]);
      }
    }
  }
  ExpectRefused("solver", Paths() + Words{"--report_path", folder_ / "output"},
                "must not be --output_path");
  for (const char* name : {"errors.csv", "errors_summary.txt"}) {
    ExpectRefused("model_comparer",
                  models + Words{"--output_path", folder_.path(),
                                 "--report_path", folder_ / name},
                  std::string("must not be ") + name + " of --output_path");
  }
  ExpectRefused(
      "solver",
      Paths() + Words{"--report_path", folder_ / "output/project.ini"},
      "must not bear the name of a model's file");
}

TEST_F(Options, ThatTheMethodDoesNotLookAtAreRefused) {
  const std::vector<Words> contradictions = {
      {"--Solver.relative_gap", "1e-3", "--Solver.method", "res_int"},
      {"--Joint.max_iterations", "9", "--Solver.method", "res_int"},
      {"--certificate_path", folder_ / "c.json", "--Solver.method", "res_int"},
      {"--certificate_path", folder_ / "c.json", "--Solver.settings", "paper"},
      {"--Solver.relative_gap", "1e-3", "--Solver.norm", "3"},
      {"--ResInt.max_sweeps", "3", "--Solver.method", "joint"},
      {"--ResInt.sweep_tolerance", "1", "--Solver.method", "joint"},
      {"--Solver.settings", "fast", "--Solver.method", "joint"},
      {"--FastDescent.max_iterations", "3", "--Solver.method", "joint"},
      {"--Problem.init_max_error", "9", "--Solver.method", "joint"},
      {"--Problem.init_max_error", "9", "--Solver.method", "res_int"},
  };
  for (const Words& pair : contradictions) {
    SCOPED_TRACE(pair[0] + " " + pair[2] + " " + pair[3]);
    ExpectRefused("solver", Paths() + pair, pair[0] + " has no effect");
  }
  ExpectRefused(
      "solver",
      Paths() + Words{"--Solver.norm", "3", "--Solver.method", "joint"},
      "--Solver.method joint needs --Solver.norm 1, 2 or inf");
  ExpectRefused(
      "solver",
      Paths() + Words{"--Solver.norm", "3", "--Solver.init", "feasible"},
      "--Solver.init feasible needs --Solver.norm 1, 2 or inf");
  ExpectRefused(
      "solver",
      Paths() + Words{"--certificate_path", folder_ / "output/images.bin"},
      "must not bear the name of a model's file");
}

TEST_F(Options, ThatChooseAScheduleAreTaken) {
  for (const Words& more :
       {Words{"--Solver.init", "feasible", "--Problem.init_max_error", "50",
              "--Solver.method", "res_int"},
        Words{"--Problem.init_max_error", "50", "--ResInt.sweep_tolerance",
              "0.5"},
        Words{"--Solver.method", "joint", "--Solver.relative_gap", "1e-2",
              "--Joint.max_iterations", "100"}}) {
    Succeeded(Solve(more + Words{"--overwrite", "1"}));
  }
}

TEST_F(Options, ForSweepsAloneByNormOrSettingsSaySo) {
  const KrotResult norm = Solve({"--Solver.norm", "3"});
  EXPECT_THAT(norm.err, HasSubstr("this norm has no joint solver"));
  const KrotResult paper =
      Solve({"--Solver.settings", "paper", "--overwrite", "1"});
  EXPECT_THAT(paper.err, HasSubstr("paper settings: sweeps alone"));
}

TEST_F(Options, ThatAreUnknownComeWithTheNearestKnownOne) {
  ExpectRefused("solver", Paths() + Words{"--Solver.nrom", "1"},
                "--Solver.nrom is no option of krot solver; did you mean "
                "--Solver.norm?");
  ExpectRefused("solver", Paths() + Words{"--max_sweeps=3"},
                "did you mean --ResInt.max_sweeps?");
  ExpectRefused("solver", Paths() + Words{"--BundleAdjustment.refine", "1"},
                "krot solver -h lists them");
}

TEST_F(Options, MustBeCompleteAndUnique) {
  ExpectRefused("solver", {}, "--input_path is required");
  ExpectRefused("solver", {"--input_path", "a"}, "--output_path is required");
  ExpectRefused("model_analyzer", {}, "--path is required");
  ExpectRefused("solver", {"--input_path", "--output_path", "a"},
                "--input_path has no value");
  ExpectRefused("solver", Paths() + Words{"--Solver.norm"}, "--Solver.norm");
  ExpectRefused("solver", Paths() + Words{"--input_path", "b"},
                "--input_path is given twice");
  ExpectRefused("solver", Paths() + Words{"stray"},
                "unexpected argument 'stray'");
}

TEST_F(Options, OfThePaperAreTakenWithItsSettings) {
  Succeeded(Solve(
      {"--Solver.settings", "paper", "--FastDescent.stationarity_tolerance",
       "1e-7", "--FastDescent.step_tolerance", "1e-5",
       "--FastDescent.slope_probe=1e-7", "--FastDescent.active_tolerance",
       "1e-3", "--FastDescent.max_step", "5", "--FastDescent.max_iterations",
       "20", "--ResInt.max_sweeps", "2"}));
}

// The one option of the descent that both settings obey.
TEST_F(Options, ForIterationsPerBlockCountWithFastSettings) {
  for (const Words& command : {Words{"solver", "--Solver.method", "res_int",
                                     "--ResInt.max_sweeps", "1"},
                               Words{"point_triangulator"}}) {
    const auto cost_with = [&](const char* max_iterations) {
      Succeeded(RunKrot(command + Paths() +
                        Words{"--FastDescent.max_iterations", max_iterations,
                              "--overwrite", "1", "--report_path",
                              folder_ / "report.json"}));
      return ReadJson(folder_ / "report.json")["cost_final"].get<double>();
    };
    EXPECT_GT(cost_with("1"), cost_with("100")) << command[0];
  }
}

TEST_F(Options, ComeFromAProjectFileUnlessGivenExplicitly) {
  WriteBytes(folder_ / "project.ini",
             "log_level=0\noutput_type=TXT\noverwrite=false\n"
             "[ResInt]\nmax_sweeps=1\n[Solver]\nmethod=res_int\nnorm=inf\n");
  const KrotResult result = Succeeded(
      Solve({"--project_path", folder_ / "project.ini", "--Solver.norm", "1"}));
  EXPECT_EQ(result.err, "");
  EXPECT_THAT(result.out, HasSubstr("(p = 1)"));
  EXPECT_THAT(result.out, HasSubstr("after 1 sweep"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "output/cameras.txt"));
}

TEST_F(Options, InAProjectFileAreChecked) {
  const std::string file = folder_ / "project.ini";
  const Words arguments = Paths() + Words{"--project_path", file};
  WriteBytes(file, "[Solver]\nnorm=0\n");
  ExpectRefused("solver", arguments, "Solver.norm in " + file + " = 0, must");
  WriteBytes(file, "[Mapper]\nba_refine_focal_length=true\n");
  ExpectRefused("solver", arguments,
                "Mapper.ba_refine_focal_length in " + file +
                    " is no option of krot solver");
  WriteBytes(file, "[Solver]\nnorm=1\nnorm=2\n");
  ExpectRefused("solver", arguments, "is given twice");
  WriteBytes(file, "[Solver\nnorm\n");
  ExpectRefused("solver", arguments, file);
  // Not even one without an end is read.
  ExpectRefused("solver", Paths() + Words{"--project_path", "/dev/zero"},
                "must be a file that can be read");
  EXPECT_THAT(RunKrot({"certificate_checker", "--input_path", folder_.path(),
                       "--certificate_path", "/dev/zero"}),
              IsRefused(2, "krot certificate_checker", "not a regular file"));
}

TEST_F(Options, InAProjectFileMayComeFromWindows) {
  WriteBytes(folder_ / "project.ini",
             "\xef\xbb\xbf; of a colleague\r\noutput_type=txt ; not PLY\r\n"
             "# sweeps\r\n[ResInt]\r\n  ; few\r\nmax_sweeps=1\r\n"
             "[Solver]\r\nmethod=RES_INT\r\n");
  const KrotResult result =
      Succeeded(Solve({"--project_path", folder_ / "project.ini"}));
  EXPECT_THAT(result.out, HasSubstr("after 1 sweep"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "output/cameras.txt"));
  WriteBytes(folder_ / "utf16.ini", std::string("\xff\xfe[\0S\0", 6));
  ExpectRefused("solver",
                Paths() + Words{"--project_path", folder_ / "utf16.ini"},
                "utf16.ini: found UTF-16, expected UTF-8");
}

TEST_F(Options, OfColmapsAdjusterAreTakenWhereTheyChangeNothing) {
  const std::vector<Words> without_effect = {
      {"use_gpu", "0"},
      {"gpu_index", "-1"},
      {"min_num_images_gpu_solver", "50"},
      {"min_num_residuals_for_cpu_multi_threading", "50000"},
      {"max_num_images_direct_dense_gpu_solver", "200"},
      {"max_num_images_direct_sparse_gpu_solver", "4000"}};
  const Words adjust =
      Words{"bundle_adjuster", "--BundleAdjustmentCeres.num_threads", "1"} +
      Paths();
  Succeeded(RunKrot(adjust));
  const Model expected = Load(folder_ / "output");
  const std::string help = RunKrot({"bundle_adjuster", "-h"}).out;
  for (const std::string group :
       {"--BundleAdjustmentCeres.", "--BundleAdjustment."}) {
    Words all = {"--BundleAdjustment.backend",
                 "ceres",
                 "--overwrite",
                 "1",
                 group + "max_num_images_direct_dense_cpu_solver",
                 "50"};
    for (const Words& option : without_effect) {
      all = all + Words{group + option[0], option[1]};
      EXPECT_THAT(help, HasSubstr(group.substr(2) + option[0]));
    }
    Succeeded(RunKrot(adjust + all));
    EXPECT_THAT(Load(folder_ / "output"), IsModel(expected));
    ExpectRefused("bundle_adjuster", Paths() + Words{group + "use_gpu", "1"},
                  group + "use_gpu = 1, must be 0: KROT adjusts on the CPU");
  }
  ExpectRefused("bundle_adjuster",
                Paths() + Words{"--BundleAdjustment.backend", "CASPAR"},
                "must be CERES: KROT adjusts with no other solver");
}

TEST_F(Options, OfColmapsEarlyDaysAreAnsweredWithTodays) {
  ExpectRefused("solver",
                {"--import_path", folder_ / "input", "--export_path", "a"},
                "did you mean --input_path?");
  ExpectRefused("bundle_adjuster",
                {"--input_path", folder_ / "input", "--export_path", "a"},
                "did you mean --output_path?");
}

TEST_F(Options, ThatAreWordsMayBeInAnyCase) {
  for (const char* type : {"bin", "Bin", "BIN"}) {
    Succeeded(Solve({"--output_type", type, "--overwrite", "1"}));
    EXPECT_TRUE(std::filesystem::exists(folder_ / "output/cameras.bin"));
  }
  Succeeded(
      RunKrot(Words{"bundle_adjuster", "--overwrite", "1",
                    "--BundleAdjustmentCeres.loss_function_type", "cauchy"} +
              Paths()));
}

TEST_F(Options, ForPointsFromMatchesAndFromTracksDoNotMix) {
  ExpectRefused("point_triangulator", Words{"--clear_points", "1"} + Paths(),
                "--clear_points has no effect without --database_path");
  ExpectRefused(
      "point_triangulator",
      Words{"--database_path", "d.db", "--Solver.norm", "1"} + Paths(),
      "--Solver.norm has no effect with --database_path");
}

}  // namespace
}  // namespace krot::internal
