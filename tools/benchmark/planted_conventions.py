#!/usr/bin/env python3
"""How often krot model_checker finds that a model is not in COLMAP's conventions.

Usage: planted_conventions.py KROT MODEL [DATABASE]

MODEL, without rigs, is in COLMAP's conventions. Its poses are written as by each of 384 programs:
quaternions with w first or last, rotations to or from the camera, translations or centres, right-
or left-handed, with each of the 24 camera axes that are COLMAP's up to their directions; and, with
COLMAP's poses, its 2D points with each of seven other axes: from another corner of the photo, or
rows first. Prints how many of them were found as they are, how many otherwise though with the same
errors, and how many not; with DATABASE the same of models without points. Needs colmap.
"""

import collections
import copy
import itertools
import json
import pathlib
import sys
import tempfile

from planted_faults import Model, multiply, rotation, run, to_text


def transposed(A):
    return tuple(zip(*A))


def applied(A, x):
    return [sum(a * v for a, v in zip(row, x)) for row in A]


def axis_rotations():
    """Unit quaternions that take axes to axes; of q and -q the first."""
    turns = {}
    for q in itertools.product((-1, 0, 1), repeat=4):
        length = sum(v * v for v in q) ** 0.5
        if length in (1, 2 ** 0.5, 2):
            unit = [v / length for v in q]
            key = tuple(round(v) for row in rotation(*unit) for v in row)
            turns.setdefault(key, unit)
    assert len(turns) == 24
    return list(turns.values())


def written(pose, w_last, inverse, centers, left_handed, turn):
    """A pose of COLMAP in the numbers of that program."""
    q, t = multiply(turn, pose[:4]), applied(rotation(*turn), pose[4:])
    if left_handed:  # y is turned round, of the world and of the camera
        q, t = [q[0], -q[1], q[2], -q[3]], [t[0], -t[1], t[2]]
    if centers:
        t = [-v for v in applied(transposed(rotation(*q)), t)]
    if inverse:
        q = [q[0], *(-v for v in q[1:])]
    return ([*q[1:], q[0]] if w_last else list(q)) + list(t)


def found(krot, folder, database):
    run(krot, "model_checker", "--input_path", folder / "planted", "--report_path",
        folder / "report.json", *(["--database_path", database] if database else []))
    return json.loads((folder / "report.json").read_text())["conventions"]


def plant(krot, model, folder, database, program):
    planted = copy.deepcopy(model)
    for image in planted.images.values():
        image[0] = written(image[0], *program)
    if program[3]:
        for point in planted.points3D.values():
            point[1] = repr(-float(point[1]))
    if database:
        planted.points2D = {image: [] for image in planted.points2D}
    run("rm", "-rf", folder / "planted")
    planted.write(folder / "planted")
    conventions = found(krot, folder, database)
    if conventions is None:
        is_colmaps = program[:4] == (False,) * 4 and abs(program[4][0]) == 1
        return "as they are" if is_colmaps else "not"
    names = ("has_w_last", "is_world_from_cam", "has_centers", "is_left_handed")
    is_same = tuple(conventions[name] for name in names) == program[:4]
    return "as they are" if is_same else "otherwise"


def turned(x, y, width, height, axes):
    """A pixel with x and y from the far side, or exchanged."""
    x_from_right, y_from_bottom, rows_first = axes
    pixel = (width - x if x_from_right else x, height - y if y_from_bottom else y)
    return pixel[::-1] if rows_first else pixel


def plant_pixels(krot, model, folder, axes):
    planted = copy.deepcopy(model)
    sizes = {row[0]: [float(v) for v in row[2:4]] for row in model.rows("cameras.txt")}
    for image, points in planted.points2D.items():
        width, height = sizes[planted.images[image][1]]
        for point in points:
            point[:2] = turned(*point[:2], width, height, axes)
    run("rm", "-rf", folder / "planted")
    planted.write(folder / "planted")
    conventions = found(krot, folder, None)
    if conventions is None:
        return "not"
    directions = [("right", "left"), ("down", "up")]
    x, y = (pair[far] for pair, far in zip(directions, axes))
    words = f"x {y}, y {x}" if axes[2] else f"x {x}, y {y}"
    return "as they are" if conventions["pixel_axes"] == words else "otherwise"


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    krot, path, *database = map(pathlib.Path, sys.argv[1:])
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        to_text(path, folder / "base")
        model = Model(folder / "base")
        counts = collections.Counter(
            plant(krot, model, folder, database[0] if database else None, program)
            for program in itertools.product(
                *[(False, True)] * 4, axis_rotations()))
        if not database:
            counts.update(plant_pixels(krot, model, folder, axes)
                          for axes in itertools.product((False, True), repeat=3)
                          if any(axes))
    print(f"| {path.name} | " + " | ".join(
        f"{counts[how]}" for how in ("as they are", "otherwise", "not")) + " |")


if __name__ == "__main__":
    main()
