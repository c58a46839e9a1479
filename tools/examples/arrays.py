"""Rotations and pixels in, positions and a bound out.

A ring of cameras looks at a cloud of points; pixels are wrong by up to one.
"""

import numpy as np

import pykrot

CAMERAS, POINTS, FOCAL_LENGTH = 12, 200, 1000.0

random = np.random.default_rng(1)
points = random.uniform(-1, 1, (POINTS, 3))
angles = 2 * np.pi * np.arange(CAMERAS) / CAMERAS
rotations = np.array([[[np.cos(a), 0, np.sin(a)],
                       [0, 1, 0],
                       [-np.sin(a), 0, np.cos(a)]] for a in angles])

# The cameras look at the origin from a distance of 5.
in_camera = np.einsum("cij,pj->cpi", rotations, points) + [0, 0, 5]
pixels = FOCAL_LENGTH * in_camera[..., :2] / in_camera[..., 2:] + [960, 540]
pixels += random.uniform(-1, 1, pixels.shape)

problem = pykrot.Problem(
    observations=pixels.reshape(-1, 2),
    image_indices=np.repeat(np.arange(CAMERAS), POINTS),
    point_indices=np.tile(np.arange(POINTS), CAMERAS),
    rotations=rotations,
    cameras=[("SIMPLE_PINHOLE", 1920, 1080, [FOCAL_LENGTH, 960, 540])])
result = pykrot.solve(problem, finish="none")
print(f"largest error {result.max_error:.4f} px; "
      f"none below {result.lower_bound:.4f} px is possible")
assert result.points.shape == (POINTS, 3)
assert result.lower_bound <= result.max_error <= 1.001 * result.lower_bound
