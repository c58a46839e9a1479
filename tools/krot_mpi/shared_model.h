#pragma once

#include "krot/base/context.h"
#include "krot/model/derived_models.h"
#include "krot/pipeline/solve_model.h"
#include "tools/krot/model_files.h"

namespace krot::internal {

// A model that ranks solve together. Every rank reads its share; where that
// needs the whole model (ReadShare), it reads all and keeps its share. During
// the solve no rank has all observations. After the solve the first rank
// reads the model again and receives the results of all ranks.
class SharedModel {
 public:
  // Keeps references.
  SharedModel(const ModelPaths& paths, Ranks* ranks)
      : paths_(paths), ranks_(*ranks) {}

  // Returns this rank's share of the points, or the whole model: on all ranks,
  // or if `first_needs_whole` on the first. Every rank must call it.
  Model Read(bool first_needs_whole, const LogOptions& log, RunRecord* run);

  // Returns this rank's share of what it has read.
  Model Take(Model read);

  // Joins the shares after the solve; every rank must call it. On the first
  // rank `*solved` becomes the whole solved model, and the summary refers to
  // that. If an HTML page is to be written, `*model` becomes the whole model as
  // it was read; otherwise it must not be used. Returns whether this is the
  // first rank.
  bool Join(Model* model, Model* solved, SolveSummary* summary) const;

 private:
  // Replaces indices of 2D points of the support, which count within shares, by
  // those of the whole model.
  void NameInWhole(const Model& share, SolveSummary* summary) const;

  const ModelPaths& paths_;
  Ranks& ranks_;
  bool is_share_ = false;                          // what Read has returned
  std::vector<std::vector<uint32_t>> point2D_of_;  // see ModelShare
};

}  // namespace krot::internal
