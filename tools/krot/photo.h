#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace krot::internal {

// The pixels of a photo: rows from the top, three bytes (red, green, blue)
// each.
struct Photo {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> rgb;
};

// Reads a PNG or JPEG file, whatever its name. None if it is neither, is
// broken, or cannot be opened.
std::optional<Photo> ReadPhoto(const std::string& path);

// The part of `size` x `size` pixels (> 0) whose upper left corner is (left,
// top); what lies outside of the photo is grey.
Photo CropPhoto(const Photo& photo, int left, int top, int size);

// The photo in width x height pixels, at most as many as it has; each is the
// mean of the pixels that it replaces.
Photo ShrinkPhoto(const Photo& photo, int width, int height);

// The photo as the bytes of a JPEG file.
std::vector<uint8_t> EncodeJpeg(const Photo& photo);

}  // namespace krot::internal
