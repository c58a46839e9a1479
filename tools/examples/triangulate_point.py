"""The point whose largest error in five cameras is lowest, by the paper's Fast
Descent Method: the way down is the centre of the smallest ball that encloses the
directions in which the largest errors fall.
"""

import numpy as np

import pykrot

FOCAL_LENGTH = 800.0
truth = np.array([0.3, -0.2, 4.0])
noise_px = np.array([[0.7, 0.1], [-0.4, 0.5], [0.2, -0.8], [-0.6, -0.3],
                     [0.1, 0.9]])

# The cameras stand in a row and look along z.
cameras = np.arange(5)
translations = np.stack([0.5 * (cameras - 2), 0.1 * cameras, 0 * cameras], 1)
in_camera = truth + translations
pixels = (FOCAL_LENGTH * in_camera[:, :2] / in_camera[:, 2:] + [500, 500] +
          noise_px)

problem = pykrot.Problem(
    observations=pixels, image_indices=cameras,
    point_indices=np.zeros(5, np.int64),
    rotations=np.broadcast_to(np.eye(3), (5, 3, 3)).copy(),
    cameras=[("SIMPLE_PINHOLE", 1000, 1000, [FOCAL_LENGTH, 500, 500])],
    translations=translations, points=np.array([[0.0, 0.0, 1.0]]))
result = pykrot.triangulate(problem, settings="paper")
print(result.points[0], f"{result.max_error:.4f} px")
# The true point is one candidate, so the optimum is no worse.
assert result.max_error <= np.linalg.norm(noise_px, axis=1).max()
