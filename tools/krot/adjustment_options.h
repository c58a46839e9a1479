#pragma once

#include "krot/pipeline/adjust_model.h"
#include "tools/krot/option_parser.h"

namespace krot {

// The options of `bundle_adjuster`, under COLMAP 4's names, and under 3.8's.
class AdjustmentOptions {
 public:
  void AddTo(OptionParser* parser);

  // What they say. Throws OptionError for pairs that contradict each other. To
  // be called after Parse.
  AdjustModelOptions Resolve(const OptionParser& parser) const;
  int num_threads() const { return num_threads_; }

 private:
  void AddRefined(OptionParser* parser);
  void AddCeres(OptionParser* parser);
  void AddCap(OptionParser* parser);

  BundleAdjustmentOptions adjustment_;
  int num_threads_ = -1;
  bool refine_extrinsics_ = true;
  double max_error_ = 0;
  double max_error_factor_ = 0;
};

}  // namespace krot
