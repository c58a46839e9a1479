// For builds without libraries that read photos: none can be read.

#include "tools/krot/photo.h"

namespace krot::internal {

std::optional<Photo> ReadPhoto(const std::string&) { return std::nullopt; }

Photo CropPhoto(const Photo& photo, int, int, int) { return photo; }

Photo ShrinkPhoto(const Photo& photo, int, int) { return photo; }

std::vector<uint8_t> EncodeJpeg(const Photo&) { return {}; }

}  // namespace krot::internal
