"""KROT for Python: the known rotation problem on COLMAP models.

Every function takes a Model (or a Problem of numpy arrays, or a
pycolmap.Reconstruction) and the options of the krot command of the same purpose, under the command line's names without
their group: --Solver.relative_gap is relative_gap=1e-4. A name that two groups
share is spelled out: options={"Solver.num_threads": 2}. docs/cli.md lists all.

    import pykrot

    result = pykrot.solve(pykrot.Model.read("sparse/0"))
    print(result.max_error, "px, none below", result.lower_bound)
    result.model.write("sparse/linf")
"""

import json
from dataclasses import dataclass
from typing import Any, Optional

from pykrot import _core
from pykrot._core import Model, ModelError, OptionError, WriteError
from pykrot.problem import Problem
from pykrot.through_memory import (from_pycolmap, is_reconstruction,
                                   to_pycolmap)

__version__ = _core.__version__
__all__ = [
    "Model", "ModelError", "NoSolutionError", "OptionError", "Problem",
    "Result", "Verdict", "WriteError", "bundle_adjust", "check",
    "check_certificate", "compare", "filter", "from_pycolmap", "solve",
    "to_pycolmap", "tolerances", "triangulate"
]

_WITHOUT_RESULT = ("nothing_to_solve", "nothing_to_adjust", "infeasible",
                   "infeasible_start", "no_start", "no_estimate")


class NoSolutionError(RuntimeError):
    """There is no new model; `report` says why, `certificate` may prove it."""

    def __init__(self, result):
        super().__init__(f"no solution: {result.report['termination']}")
        self.report = result.report
        self.certificate = result.certificate


@dataclass
class Result:
    """A new model, and what its command would write into report.json."""
    model: Model
    report: dict
    certificate: Optional[str]  # JSON: of the bound, or the conflicts
    # The new model as a pycolmap.Reconstruction, where one was given.
    reconstruction: Optional[Any] = None

    @property
    def max_error(self):
        """The largest pixel error of the new model."""
        return self.report["pixel_error"]["after"]["max"]

    @property
    def lower_bound(self):
        """Pixels that no translations and points are below, proved; or None."""
        return self.report.get("lower_bound")

    @property
    def translations(self):
        """Camera from world, by image: (images, 3)."""
        return self.model.translations

    @property
    def points(self):
        """(points, 3)."""
        return self.model.points


@dataclass
class Verdict:
    """What a certificate or a file of conflicts proves about a model."""
    is_accepted: bool
    refusal: str
    lower_bound: float  # pixels; of conflicts: the bound that they refute
    num_conflicts: Optional[int]  # so many observations at least must go


def _as_model(scene):
    if isinstance(scene, Model):
        return scene
    if isinstance(scene, Problem):
        return scene.to_model()
    if is_reconstruction(scene):
        return from_pycolmap(scene)
    raise TypeError(f"found a {type(scene).__name__}, expected a pykrot.Model, "
                    "a pykrot.Problem or a pycolmap.Reconstruction")


def _run(command, model, progress, options, keywords):
    outcome = command(_as_model(model), progress, {**(options or {}), **keywords})
    result = Result(outcome.model, json.loads(outcome.report),
                    outcome.certificate)
    if result.report.get("termination") in _WITHOUT_RESULT:
        raise NoSolutionError(result)
    if is_reconstruction(model):
        result.reconstruction = to_pycolmap(result.model, type(model)())
    return result


def solve(model, *, progress=None, options=None, **keywords):
    """The lowest largest error, proved; of all such, the least squares.

    progress(stage, max_error, lower_bound) is called as it goes; both may be
    None. Raises OptionError, NoSolutionError, KeyboardInterrupt.
    """
    return _run(_core.solve, model, progress, options, keywords)


def triangulate(model, *, progress=None, options=None, **keywords):
    """Every point anew, its track's largest error the lowest; frames stay."""
    return _run(_core.triangulate, model, progress, options, keywords)


def check(model, database=None, **keywords):
    """What is wrong with a model, and the model without it.

    report["verdict"] is a sentence; "images", "observations" and "tracks" have
    the numbers that it rests on. With `database`, the path of COLMAP's, its
    verified matches are asked, too: report["database"].
    """
    if database is not None:
        keywords["database_path"] = database
    return _run(_core.check, model, None, None, keywords)


def filter(model, max_error=None, *, progress=None, options=None, **keywords):
    """Removes the observations that noise does not explain.

    With `max_error` px few, so that all others are within it:
    report["num_must_go"] says how many had to go, and `certificate` proves it.
    """
    if max_error is not None:
        keywords["max_error"] = max_error
    return _run(_core.filter, model, progress, options, keywords)


def bundle_adjust(model, *, progress=None, options=None, **keywords):
    """Least squares over everything, below a cap if max_error is given."""
    return _run(_core.bundle_adjust, model, progress, options, keywords)


def tolerances(model, max_error, *, images=(), points=(), progress=None,
               options=None, **keywords):
    """Everywhere that positions may be with all errors within `max_error` px.

    Of all images, unless some are named (by name or id) or points (by id).
    report["boxes"] holds them; `model` is the one around which they stand.
    """
    named = {name: ",".join(map(str, values))
             for name, values in (("images", images), ("points", points))
             if len(values) > 0}
    return _run(_core.tolerances, model, progress, options,
                {"max_error": max_error, **named, **keywords})


def compare(model1, model2, *, alignment="frame", num_worst=10):
    """How two models of the same images differ: model_comparer's JSON."""
    report = _core.compare(_as_model(model1), _as_model(model2), alignment,
                           num_worst)
    if report is None:
        raise ValueError("the models share too few images to be aligned")
    return json.loads(report)


def check_certificate(model, certificate):
    """Judges a certificate's or conflicts' JSON from the model alone."""
    return Verdict(*_core.check_certificate(_as_model(model), certificate))
