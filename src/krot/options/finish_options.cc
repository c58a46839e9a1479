#include "krot/options/finish_options.h"

namespace krot::internal {

void AddFinishOptions(SolveModelOptions* options, OptionTable* table) {
  FinishOptions* finish = &options->finish;
  table->AddNamed<Finish>(
      "Solver.finish", &finish->finish,
      {{FinishName(Finish::kLeastSquares), Finish::kLeastSquares},
       {FinishName(Finish::kNone), Finish::kNone}},
      "With method auto: least_squares: end at the least squares of all "
      "estimates within finish_slack of the lowest maximum; none: end at the "
      "lowest maximum");
  table->AddReal("Solver.finish_slack", &finish->slack,
                 Above(0.0, "relative to the lowest maximum"),
                 "With finish least_squares: how far above the lowest maximum "
                 "an error may be");
  AddFinishLoss(options, table);
  table->AddNamed<Polish>(
      "Solver.polish", &options->polish,
      {{PolishName(Polish::kNone), Polish::kNone},
       {PolishName(Polish::kRotationsFixed), Polish::kRotationsFixed},
       {PolishName(Polish::kFull), Polish::kFull}},
      "A bundle adjustment at the end, which gives up the lowest maximum: "
      "rotations_fixed: of translations and points; full: as bundle_adjuster");
}

void AddFinishLoss(SolveModelOptions* options, OptionTable* table) {
  ErrorLoss* loss = &options->finish.loss;
  table->AddNamed<ErrorLoss::Kind>(
      "Solver.finish_loss", &loss->kind,
      {{LossName(ErrorLoss::Kind::kTrivial), ErrorLoss::Kind::kTrivial},
       {LossName(ErrorLoss::Kind::kHuber), ErrorLoss::Kind::kHuber},
       {LossName(ErrorLoss::Kind::kCauchy), ErrorLoss::Kind::kCauchy}},
      "The loss of the squared errors; huber and cauchy count large ones less");
  table->AddReal("Solver.finish_loss_scale", &loss->scale, Above(0.0, "pixels"),
                 "With huber or cauchy: the error above which it counts less");
}

void CheckFinishLoss(const SolveModelOptions& options,
                     const OptionTable& table) {
  if (options.finish.loss.kind != ErrorLoss::Kind::kTrivial) return;
  table.Refuse("Solver.finish_loss_scale",
               "without --Solver.finish_loss huber or cauchy");
}

void CheckFinishOptions(const SolveModelOptions& options,
                        const OptionTable& table) {
  const bool has_least_squares = options.finish.finish == Finish::kLeastSquares;
  for (const char* name : {"Solver.finish_slack", "Solver.finish_loss",
                           "Solver.finish_loss_scale"}) {
    if (!has_least_squares) {
      table.Refuse(name, "without --Solver.finish least_squares");
    }
  }
  CheckFinishLoss(options, table);
  if (EffectiveMethod(options) == SolveMethod::kAuto) return;
  for (const char* name : {"Solver.finish", "Solver.finish_slack",
                           "Solver.finish_loss", "Solver.finish_loss_scale"}) {
    table.Refuse(name, "but with --Solver.method auto");
  }
}

}  // namespace krot::internal
