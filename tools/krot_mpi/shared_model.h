#pragma once

#include "krot/base/context.h"
#include "krot/model/derived_models.h"
#include "krot/pipeline/solve_model.h"
#include "tools/krot/model_files.h"

namespace krot::internal {

// A model that ranks solve together: every one reads it and keeps its share;
// the first one reads it again when it is solved, and takes in what the others
// have made of theirs. Between the two no rank has all observations.
class SharedModel {
 public:
  // Keeps references.
  SharedModel(const ModelPaths& paths, Ranks* ranks)
      : paths_(paths), ranks_(*ranks) {}

  Model Take(const Model& whole);

  // On the first rank: `*solved` becomes the whole as it is solved, `*model` as
  // it was read if a page is to show it, and the summary speaks of it. Whether
  // this is the first. Every rank must call it.
  bool Join(Model* model, Model* solved, SolveSummary* summary) const;

 private:
  // 2D points of the support, which are named as in the shares.
  void NameInWhole(const Model& share, SolveSummary* summary) const;

  const ModelPaths& paths_;
  Ranks& ranks_;
  std::vector<std::vector<uint32_t>> point2D_of_;  // of ModelShare
};

}  // namespace krot::internal
