#include <utility>

#include "krot/base/context.h"
#include "krot/joint/joint.h"
#include "krot/pipeline/stages.h"
#include "krot/sweeps/res_int.h"
#include "tools/benchmark/known_rotation_solver.h"

namespace krot::internal {
namespace {

// The schedule of `krot solver`, without the finish.
class Schedule : public KnownRotationSolver {
 public:
  Schedule(std::string name, SolveMethod method, int num_threads)
      : name_(std::move(name)), method_(method), num_threads_(num_threads) {}

  std::string Name() const override { return name_; }
  int NumThreads() const override { return num_threads_; }

  bool Minimize(const KnownRotationProblem& problem, const CancelFlag* cancel,
                Estimate* estimate) override {
    SolveSummary summary;
    KnownMultipliers known;
    const Timer timer;
    const Context context{num_threads_, cancel};
    SolveRows(problem, {/*model=*/{}, {}, method_, context, timer},
              /*have_rows_served=*/{}, estimate, &known, &summary);
    return !IsCancelled(cancel);
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

  bool Minimize(const KnownRotationProblem& problem, const CancelFlag* cancel,
                Estimate* estimate) override {
    ResIntOptions options;
    options.fast_descent.settings = settings_;
    options.sweep_tolerance = 1e-3;  // the paper's
    const ResIntSummary summary =
        SolveResInt(problem, options, {num_threads_, cancel}, estimate);
    return summary.termination != SolveTermination::kInterrupted;
  }

 private:
  std::string name_;
  FastDescentSettings settings_;
  int num_threads_;
};

using Solvers = std::vector<std::unique_ptr<KnownRotationSolver>>;

void AddSweeps(const std::string& name, FastDescentSettings settings,
               int num_threads, Solvers* solvers) {
  solvers->push_back(std::make_unique<Sweeps>(name, settings, 1));
  if (num_threads == 1) return;
  solvers->push_back(std::make_unique<Sweeps>(name, settings, num_threads));
}

}  // namespace

Solvers OwnFullSolvers(int num_threads) {
  Solvers solvers;
  solvers.push_back(
      std::make_unique<Schedule>("KROT auto", SolveMethod::kAuto, num_threads));
  solvers.push_back(std::make_unique<Schedule>(
      "KROT joint", SolveMethod::kJoint, num_threads));
  AddSweeps("sweeps fast", FastDescentSettings::kFast, num_threads, &solvers);
  return solvers;
}

Solvers PaperFullSolvers(int num_threads) {
  Solvers solvers;
  AddSweeps("Res-Int (paper)", FastDescentSettings::kPaper, num_threads,
            &solvers);
  return solvers;
}

}  // namespace krot::internal
