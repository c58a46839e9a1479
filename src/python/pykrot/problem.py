"""A known rotation problem as numpy arrays."""

from dataclasses import dataclass
from typing import Optional, Sequence, Tuple

import numpy as np

from pykrot._core import Model


@dataclass
class Problem:
    """Pixels, who sees what, and the rotations.

    observations    (n, 2)  pixels; the upper left pixel's centre is (0.5, 0.5)
    image_indices   (n,)    which image each is in
    point_indices   (n,)    which point each is of
    rotations       (images, 3, 3)  camera from world
    cameras         [(COLMAP's model name, width, height, parameters), ...]
    camera_indices  (images,)  None: all images are of the first camera
    translations    (images, 3)  camera from world, to start from
    points          (points, 3)  to start from

    Without translations or points the solve starts from nothing.
    """
    observations: np.ndarray
    image_indices: np.ndarray
    point_indices: np.ndarray
    rotations: np.ndarray
    cameras: Sequence[Tuple[str, int, int, Sequence[float]]]
    camera_indices: Optional[np.ndarray] = None
    translations: Optional[np.ndarray] = None
    points: Optional[np.ndarray] = None

    @classmethod
    def from_model(cls, model, cameras, camera_indices=None):
        """Of the images and points of a model, in their order."""
        observations, image_indices, point_indices = model.observations()
        return cls(observations, image_indices, point_indices, model.rotations,
                   cameras, camera_indices, model.translations,
                   np.array(model.points))

    def to_model(self):
        """The COLMAP model; images are called 0.png, 1.png, ..."""
        num_images = len(self.rotations)
        num_points = (len(self.points) if self.points is not None else
                      int(np.max(self.point_indices, initial=-1)) + 1)
        has_start = self.translations is not None and self.points is not None
        return Model.from_arrays(
            self.observations, self.image_indices, self.point_indices,
            self.rotations,
            self.translations if has_start else np.full((num_images, 3),
                                                        np.nan),
            self.points if has_start else np.zeros((num_points, 3)),
            list(self.cameras),
            (np.zeros(num_images, np.int64)
             if self.camera_indices is None else self.camera_indices),
            [f"{n}.png" for n in range(num_images)])
