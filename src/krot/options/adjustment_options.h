#pragma once

#include "krot/options/option_table.h"
#include "krot/pipeline/adjust_model.h"

namespace krot::internal {

// The options of `bundle_adjuster`, under COLMAP 4's names, and under 3.8's.
class AdjustmentOptions {
 public:
  void AddTo(OptionTable* table);

  // What they say. Throws OptionError for pairs that contradict each other. To
  // be called once they are set.
  AdjustModelOptions Resolve(const OptionTable& table) const;
  int num_threads() const { return num_threads_; }

 private:
  void AddRefined(OptionTable* table);
  void AddCeres(OptionTable* table);
  void AddWithoutEffect(OptionTable* table);
  void AddCap(OptionTable* table);

  BundleAdjustmentOptions adjustment_;
  int num_threads_ = -1;
  bool refine_extrinsics_ = true;
  double max_error_ = 0;
  double max_error_factor_ = 0;
};

}  // namespace krot::internal
