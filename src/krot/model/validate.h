#pragma once

#include "krot/model/model.h"

namespace krot {

// Checks everything that the rest of KROT relies on:
//  1. ids are unique, and none is the largest of its type, which in COLMAP
//     stands for none;
//  2. camera model ids are known and have as many parameters as they need; of
//     cameras with images no focal length is zero;
//  3. references resolve: image -> camera, rig -> camera, frame -> rig,
//     frame -> image, track -> image and 2D point;
//  4. tracks follow one another in Model::track_elements without gaps;
//  5. with rigs, every image belongs to exactly one frame, as data of its own
//     camera, and that camera has a pose in the frame's rig;
//  6. image names hold no zero byte;
//  7. numbers are finite and quaternions are not zero, with three exceptions:
//     the pose of an image or a frame may be NaN, infinite or have a quaternion
//     of zeros and counts as absent (see the bridge); 2D points in no track,
//     whose coordinates COLMAP's undistorter may write as NaN; and stored point
//     errors, which are recomputed by KROT.
// An image's own pose may contradict its frame's: the frame's counts, as in
// COLMAP 4. A 3D point may have any track length, none included. What 2D
// points say of their 3D points may contradict the tracks: those count (see
// contradictions.h).
//
// Throws ModelError naming the first offender. O(size of the model), a few ns
// per 2D point.
void ValidateModel(const Model& model);

}  // namespace krot
