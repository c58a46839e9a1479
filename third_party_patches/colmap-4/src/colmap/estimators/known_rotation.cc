// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#include "colmap/estimators/known_rotation.h"

#include "colmap/estimators/krot_model.h"
#include "colmap/util/logging.h"

#include <exception>
#include <sstream>
#include <utility>
#include <vector>

#include <krot/base/timer.h>
#include <krot/options/outlier_filter_options.h>
#include <krot/options/solver_options.h>
#include <krot/outliers/outlier_filter.h>
#include <krot/outliers/tolerant_solve.h>
#include <krot/report/outlier_report.h>
#include <krot/report/solve_report.h>

namespace colmap {
namespace {

// Exactly as many digits as it takes to read the same number.
std::string Text(const double value) {
  std::ostringstream text;
  text.precision(17);
  text << value;
  return text.str();
}

// The options as KROT checks them; throws krot::OptionError.
krot::TolerantSolveOptions Resolve(const KnownRotationOptions& options,
                                   krot::Context& context) {
  krot::TolerantSolveOptions resolved;
  krot::OptionTable table("known_rotation_solver",
                          "",
                          "colmap known_rotation_solver -h");
  krot::AddSolverOptions(&resolved, &context, &table);
  std::vector<krot::OptionAssignment> assignments;
  const auto assign = [&](const std::string& name, const std::string& text) {
    assignments.push_back({"Solver." + name, text, "KnownRotation." + name});
  };
  assign("init", options.init);
  if (options.max_error > 0) assign("max_error", Text(options.max_error));
  assign("relative_gap", Text(options.relative_gap));
  assign("finish", options.finish);
  if (options.finish_loss != "trivial") {
    assign("finish_loss", options.finish_loss);
  }
  assign("num_threads", std::to_string(options.num_threads));
  table.Assign(assignments);
  krot::ResolveSolverOptions(table, &resolved.solve);
  return resolved;
}

krot::OutlierFilterOptions Resolve(const OutlierFilterOptions& options,
                                   krot::Context& context) {
  krot::OutlierFilterOptions resolved;
  krot::OptionTable table("outlier_filter", "", "colmap outlier_filter -h");
  krot::AddOutlierFilterOptions(&resolved, &context, &table);
  table.Assign({{"OutlierFilter.max_error",
                 Text(options.max_error),
                 "OutlierFilter.max_error"},
                {"Solver.num_threads",
                 std::to_string(options.num_threads),
                 "OutlierFilter.num_threads"}});
  return resolved;
}

// Logs what an exception says; one sentence.
template <typename Function>
bool Try(const Function& function) {
  try {
    return function();
  } catch (const std::exception& error) {
    LOG(ERROR) << error.what();
    return false;
  }
}

template <typename Options>
bool CanBeResolved(const Options& options) {
  return Try([&options]() {
    krot::Context context;
    Resolve(options, context);
    return true;
  });
}

// A solve without a new model.
bool HasResult(const krot::SolveSummary& summary) {
  switch (summary.termination) {
    case krot::SolveTermination::kNothingToSolve:
    case krot::SolveTermination::kInfeasible:
    case krot::SolveTermination::kNoStart:
      LOG(ERROR) << "KROT: no estimate of this problem was found";
      return false;
    default:
      return true;
  }
}

bool Solve(const krot::TolerantSolveOptions& options,
           krot::Context context,
           Reconstruction& reconstruction) {
  const krot::Timer timer;
  context.on_note = [](const std::string& note) { LOG(INFO) << note; };
  krot::TolerantSolveResult result =
      krot::SolveTolerantly(ToKrotModel(reconstruction), options, context);
  if (!HasResult(result.summary)) return false;
  krot::SolveReport report;
  krot::RecordEnd(timer, context.num_threads, &report.run);
  report.command = "known_rotation_solver";
  report.method = krot::MethodName(result.summary.method);
  report.summary = std::move(result.summary);
  report.outliers = std::move(result.outliers);
  LOG(INFO) << "\n" << krot::SolveTable(report);
  UpdateFromKrotModel(result.model, reconstruction);
  return true;
}

}  // namespace

bool KnownRotationOptions::Check() const { return CanBeResolved(*this); }

bool OutlierFilterOptions::Check() const { return CanBeResolved(*this); }

bool SolveKnownRotation(const KnownRotationOptions& options,
                        Reconstruction& reconstruction) {
  return Try([&]() {
    krot::Context context;
    const krot::TolerantSolveOptions resolved = Resolve(options, context);
    return Solve(resolved, context, reconstruction);
  });
}

bool FilterOutliers(const OutlierFilterOptions& options,
                    Reconstruction& reconstruction) {
  return Try([&]() {
    const krot::Timer timer;
    krot::Context context;
    const krot::OutlierFilterOptions resolved = Resolve(options, context);
    krot::OutlierFilterResult result =
        krot::FilterOutliers(ToKrotModel(reconstruction), resolved, context);
    krot::OutlierReport report;
    krot::RecordEnd(timer, context.num_threads, &report.run);
    report.summary = std::move(result.summary);
    LOG(INFO) << "\n" << krot::OutlierTable(report);
    UpdateFromKrotModel(result.model, reconstruction);
    return true;
  });
}

bool RunKnownRotationPositioning(const double max_error,
                                 const int num_threads,
                                 Reconstruction& reconstruction) {
  return Try([&]() {
    krot::Context context;
    context.num_threads = num_threads;
    context.on_note = [](const std::string& note) { LOG(INFO) << note; };
    krot::OutlierFilterOptions options;
    options.solve.init = krot::SolveInit::kFeasible;
    options.find_conflicts = false;
    if (max_error > 0) options.max_error = max_error;
    krot::OutlierFilterResult result =
        krot::FilterOutliers(ToKrotModel(reconstruction), options, context);
    if (result.model.track_elements.empty()) {
      LOG(ERROR) << "KROT: no positions were found";
      return false;
    }
    UpdateFromKrotModel(result.model, reconstruction);
    return true;
  });
}

}  // namespace colmap
