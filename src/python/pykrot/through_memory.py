"""To and from pycolmap, whose objects give no access to a model's arrays as a
whole: through files in memory (/dev/shm where there is one)."""

import os
import tempfile

from pykrot._core import Model


def _folder():
    return tempfile.TemporaryDirectory(
        dir="/dev/shm" if os.path.isdir("/dev/shm") else None)


def is_reconstruction(scene):
    """Whether it is a pycolmap.Reconstruction, as far as is needed here."""
    return (not isinstance(scene, Model) and
            callable(getattr(scene, "read", None)) and
            callable(getattr(scene, "write", None)))


def from_pycolmap(reconstruction):
    """A Model of a pycolmap.Reconstruction."""
    with _folder() as folder:
        reconstruction.write(folder)
        return Model.read(folder)


def to_pycolmap(model, reconstruction):
    """Reads the Model into an (empty) pycolmap.Reconstruction; returns that."""
    with _folder() as folder:
        model.write(folder)
        reconstruction.read(folder)
    return reconstruction
