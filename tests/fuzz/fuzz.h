#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {

// What the fuzz targets share: each is one LLVMFuzzerTestOneInput, which takes
// any bytes. ModelError and OptionError are answers; whatever else leaves a
// target, or breaks a Require, is a finding.

inline void Require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", what);
  std::abort();
}

// Takes the bytes of an input one after the other; zeros beyond its end.
class ByteSource {
 public:
  ByteSource(const uint8_t* data, size_t size) : data_(data), size_(size) {}

  bool IsEmpty() const { return size_ == 0; }
  uint8_t Byte() {
    if (size_ == 0) return 0;
    --size_;
    return *data_++;
  }
  template <typename T>
  T Take() {
    T value;
    auto* bytes = reinterpret_cast<uint8_t*>(&value);
    for (size_t n = 0; n < sizeof(T); ++n) bytes[n] = Byte();
    return value;
  }
  FileBytes Rest(const std::string& name) const {
    return {name, {reinterpret_cast<const char*>(data_), size_}};
  }

 private:
  const uint8_t* data_;
  size_t size_;
};

// Five frames of a rig of two cameras and 16 points, a few pixels off: its
// solve takes milliseconds.
inline SyntheticScene FuzzScene() {
  SceneOptions options = SceneOf(5, 16, 4, 0.5, 3);
  options.sensors_per_rig = 2;
  options.start_translation_noise = 0.003;
  options.start_point_noise = 0.003;
  return SynthesizeScene(options);
}

}  // namespace krot::internal
