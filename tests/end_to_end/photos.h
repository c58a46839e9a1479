#pragma once

#include <cstdint>
#include <filesystem>

#include "krot/model.h"

namespace krot::internal {

// Photos of the sample's scene (tools/sample), small enough for a test: ten
// neighbouring views of its twenty-four, at half the width and height, as PPM.

bool HasPovray();

// Renders them into `folder`; false if POV-Ray fails. Its words go to `log`.
// 15 s on one core.
bool RenderPhotos(const std::filesystem::path& folder,
                  const std::filesystem::path& log);

// The cameras of these photos as POV-Ray had them; no points.
Model TrueCameras();

// Copies of all photos of `folder` in `noisy_folder`, with Gaussian noise on
// every channel of every pixel; sigma is in grey levels of 255.
void AddNoise(const std::filesystem::path& folder, double sigma, uint64_t seed,
              const std::filesystem::path& noisy_folder);

}  // namespace krot::internal
