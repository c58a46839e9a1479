#pragma once

#include <memory>
#include <string>

#include "krot/model/fixed_parts.h"
#include "krot/model/model.h"
#include "krot/options/option_table.h"

namespace krot {

// The command line's files of what else is known than the model says, as
// keywords.
class KnownFiles {
 public:
  void AddRotationsTo(OptionTable* table);
  void AddFixedTo(OptionTable* table);

  // The model, or a copy with the file's rotations.
  std::shared_ptr<const Model> WithRotations(
      const std::shared_ptr<Model>& model) const;
  FixedParts Fixed(const Model& model) const;

 private:
  std::string rotations_path_;
  std::string fixed_images_path_;
  std::string fixed_points_path_;
};

}  // namespace krot
