#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>

#include "krot/model/model.h"
#include "krot/model/text_reader.h"

namespace krot {

// Which image bears a name, for text files that name images. Refers to the
// names of the model.
class ImageNames {
 public:
  explicit ImageNames(const Model& model) {
    for (size_t n = 0; n < model.images.size(); ++n) {
      const auto [image, is_new] =
          image_of_name_.emplace(model.images[n].name, static_cast<int32_t>(n));
      if (!is_new) image->second = kAmbiguous;
    }
  }

  bool Has(std::string_view name) const {
    return image_of_name_.count(name) > 0;
  }

  // Its index in Model::images; fails at the reader's line unless exactly one
  // image bears the name.
  int32_t Find(std::string_view name, const TextReader& reader) const {
    const std::string quoted = "\"" + std::string(name) + "\"";
    const auto image = image_of_name_.find(name);
    if (image == image_of_name_.end()) {
      reader.Fail(quoted, "the name of an image of the model");
    }
    if (image->second == kAmbiguous) {
      reader.Fail(quoted + ", which several images of the model bear",
                  "the name of one");
    }
    return image->second;
  }

 private:
  static constexpr int32_t kAmbiguous = -1;
  std::unordered_map<std::string_view, int32_t> image_of_name_;
};

}  // namespace krot
