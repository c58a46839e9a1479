// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#pragma once

#include "colmap/scene/reconstruction.h"

#include <krot/model.h>

namespace colmap {

// The registered frames of a reconstruction, with their rigs, cameras and
// images, and the 3D points whose tracks are long enough, as KROT has models;
// records in the order of their ids.
krot::Model ToKrotModel(const Reconstruction& reconstruction,
                        int min_track_length = 0);

// Takes over translations, points, errors, and which points and observations
// there are, of a model that was made of this reconstruction.
void UpdateFromKrotModel(const krot::Model& model,
                         Reconstruction& reconstruction);

}  // namespace colmap
