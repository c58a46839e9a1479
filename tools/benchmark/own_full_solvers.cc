#include <utility>

#include "krot/base/timer.h"
#include "krot/pipeline/schedule.h"
#include "krot/solver/joint.h"
#include "krot/solver/res_int.h"
#include "tools/benchmark/known_rotation_solver.h"

namespace krot {
namespace {

class Schedule : public KnownRotationSolver {
 public:
  Schedule(std::string name, SolveMethod method, int num_threads)
      : name_(std::move(name)), method_(method), num_threads_(num_threads) {}

  std::string Name() const override { return name_; }
  int NumThreads() const override { return num_threads_; }

  bool Minimize(const KnownRotationProblem& problem, double /*time_limit*/,
                Estimate* estimate) override {
    SolveModelOptions options;
    options.num_threads = num_threads_;
    SolveSummary summary;
    RunSchedule(problem, options, method_, Timer(), estimate, &summary);
    return true;
  }

 private:
  std::string name_;
  SolveMethod method_;
  int num_threads_;
};

class Sweeps : public KnownRotationSolver {
 public:
  Sweeps(std::string name, FastDescentSettings settings, int num_threads)
      : name_(std::move(name)),
        settings_(settings),
        num_threads_(num_threads) {}

  std::string Name() const override { return name_; }
  int NumThreads() const override { return num_threads_; }

  bool Minimize(const KnownRotationProblem& problem, double /*time_limit*/,
                Estimate* estimate) override {
    ResIntOptions options;
    options.fast_descent.settings = settings_;
    options.sweep_tolerance = 1e-3;  // the paper's
    options.num_threads = num_threads_;
    SolveResInt(problem, options, estimate);
    return true;
  }

 private:
  std::string name_;
  FastDescentSettings settings_;
  int num_threads_;
};

}  // namespace

std::vector<std::unique_ptr<KnownRotationSolver>> OwnFullSolvers(
    int num_threads) {
  std::vector<std::unique_ptr<KnownRotationSolver>> solvers;
  solvers.push_back(
      std::make_unique<Schedule>("KROT auto", SolveMethod::kAuto, num_threads));
  solvers.push_back(std::make_unique<Schedule>(
      "KROT joint", SolveMethod::kJoint, num_threads));
  const std::pair<const char*, FastDescentSettings> kinds[] = {
      {"sweeps fast", FastDescentSettings::kFast},
      {"Res-Int (paper)", FastDescentSettings::kPaper}};
  for (const auto& [name, settings] : kinds) {
    solvers.push_back(std::make_unique<Sweeps>(name, settings, 1));
    if (num_threads > 1) {
      solvers.push_back(std::make_unique<Sweeps>(name, settings, num_threads));
    }
  }
  return solvers;
}

}  // namespace krot
