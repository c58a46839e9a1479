from dataclasses import dataclass
from os import PathLike
from typing import (Any, Callable, Dict, List, Mapping, Optional, Sequence,
                    Tuple, Union)

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

# stage, largest error, lower bound; pixels.
Progress = Callable[[str, Optional[float], Optional[float]], None]
Camera = Tuple[str, int, int, Sequence[float]]

class ModelError(ValueError): ...
class OptionError(ValueError): ...
class WriteError(OSError): ...

class NoSolutionError(RuntimeError):
    report: Dict[str, Any]
    certificate: Optional[str]

class Model:
    @staticmethod
    def read(path: Union[str, PathLike[str]], *,
             on_contradiction: str = "auto") -> Model: ...
    @staticmethod
    def from_arrays(observations: ArrayLike, image_indices: ArrayLike,
                    point_indices: ArrayLike, rotations: ArrayLike,
                    translations: ArrayLike, points: ArrayLike,
                    cameras: List[Camera], camera_indices: ArrayLike,
                    names: List[str]) -> Model: ...
    def write(self, path: Union[str, PathLike[str]], *,
              output_type: str = "BIN", overwrite: bool = False) -> None: ...
    # Views: writing into them changes the model.
    @property
    def points(self) -> NDArray[np.float64]: ...
    @property
    def colors(self) -> NDArray[np.uint8]: ...
    # Copies.
    @property
    def point_ids(self) -> NDArray[np.uint64]: ...
    @property
    def image_ids(self) -> NDArray[np.uint32]: ...
    @property
    def image_names(self) -> List[str]: ...
    @property
    def rotations(self) -> NDArray[np.float64]: ...
    @property
    def translations(self) -> NDArray[np.float64]: ...
    @property
    def centers(self) -> NDArray[np.float64]: ...
    def observations(self) -> Tuple[NDArray[np.float64], NDArray[np.int64],
                                    NDArray[np.int64]]: ...
    def pixel_errors(self) -> NDArray[np.float64]: ...
    # sigma_px, cauchy_scale_px, critical_w, and of every observation w,
    # errors_px and redundancy.
    def noise(self, *, false_alarm: float = 0.05,
              relative_sigmas: Sequence[float] = ...) -> Dict[str, Any]: ...

@dataclass
class Problem:
    observations: ArrayLike
    image_indices: ArrayLike
    point_indices: ArrayLike
    rotations: ArrayLike
    cameras: Sequence[Camera]
    camera_indices: Optional[ArrayLike] = ...
    translations: Optional[ArrayLike] = ...
    points: Optional[ArrayLike] = ...
    @classmethod
    def from_model(cls, model: Model, cameras: Sequence[Camera],
                   camera_indices: Optional[ArrayLike] = ...) -> Problem: ...
    def to_model(self) -> Model: ...

@dataclass
class Result:
    model: Model
    report: Dict[str, Any]
    certificate: Optional[str]
    reconstruction: Optional[Any] = ...
    @property
    def max_error(self) -> float: ...
    @property
    def lower_bound(self) -> Optional[float]: ...
    @property
    def translations(self) -> NDArray[np.float64]: ...
    @property
    def points(self) -> NDArray[np.float64]: ...

@dataclass
class Verdict:
    is_accepted: bool
    refusal: str
    lower_bound: float
    num_conflicts: Optional[int]

# Or a pycolmap.Reconstruction.
Scene = Union[Model, Problem, Any]

def solve(model: Scene, *,
          progress: Optional[Progress] = ...,
          options: Optional[Mapping[str, Any]] = ...,
          **keywords: Any) -> Result: ...
def triangulate(model: Scene, *,
                progress: Optional[Progress] = ...,
                options: Optional[Mapping[str, Any]] = ...,
                **keywords: Any) -> Result: ...
def check(model: Scene,
          database: Optional[Union[str, PathLike[str]]] = ...,
          **keywords: Any) -> Result: ...
def filter(model: Scene, max_error: Optional[float] = ..., *,
           progress: Optional[Progress] = ...,
           options: Optional[Mapping[str, Any]] = ...,
           **keywords: Any) -> Result: ...
def bundle_adjust(model: Scene, *,
                  progress: Optional[Progress] = ...,
                  options: Optional[Mapping[str, Any]] = ...,
                  **keywords: Any) -> Result: ...
def tolerances(model: Scene, max_error: float, *,
               images: Sequence[Union[str, int]] = ...,
               points: Sequence[int] = ...,
               progress: Optional[Progress] = ...,
               options: Optional[Mapping[str, Any]] = ...,
               **keywords: Any) -> Result: ...
def compare(model1: Scene, model2: Scene, *, alignment: str = "frame",
            num_worst: int = 10) -> Dict[str, Any]: ...
def check_certificate(model: Scene,
                      certificate: str) -> Verdict: ...
def from_pycolmap(reconstruction: Any) -> Model: ...
def to_pycolmap(model: Model, reconstruction: Any) -> Any: ...
