#!/usr/bin/env python3
"""What `krot solver` makes of what else is known of a model.

    known_positions.py KROT MODEL

Solves MODEL, and then again with what a survey of that result would say:
cameras that are fixed, balls and ellipsoids around cameras and points, a wrong
one among them, and all of it without translations and points to begin with. A
ball's radius is 1 % of the RMS distance of the cameras from their middle. A row
has the maximum that was reached, what is proved, both in pixels, the rounds,
and the seconds; every proof is judged by certificate_checker.
"""

import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile
import time

NUM_FIXED = 5


def text_lines(path):
    return [line for line in path.read_text().splitlines()
            if line and not line.startswith("#")]


def centre(words):
    """-R't of an image's line in images.txt."""
    w, x, y, z, *t = map(float, words[1:8])
    rows = ((1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)))
    return [-sum(rows[k][axis] * t[k] for k in range(3)) for axis in range(3)]


class Survey:
    """The places of cameras and points of a model in text form."""

    def __init__(self, model):
        images = [line.split() for line in
                  (model / "images.txt").read_text().splitlines()
                  if not line.startswith("#")][0::2]
        self.cameras = {words[9]: centre(words) for words in images}
        self.points = {words[0]: list(map(float, words[1:4])) for words in
                       map(str.split, text_lines(model / "points3D.txt"))}
        middle = [sum(c[k] for c in self.cameras.values()) / len(self.cameras)
                  for k in range(3)]
        self.radius = 0.01 * math.sqrt(
            sum(math.dist(c, middle)**2 for c in self.cameras.values())
            / len(self.cameras))

    def write(self, path, places, off=0.0, wrong=None, axes=False):
        """Around each place, `off` radii from it; `wrong` is ten off."""
        generator = random.Random(1)
        lines = []
        for name, place in places.items():
            way = [generator.gauss(0, 1) for _ in range(3)]
            length = math.hypot(*way) / self.radius
            share = 10 if name == wrong else off
            lines.append(" ".join(
                [name] + [repr(p + share * w / length)
                          for p, w in zip(place, way)]
                + [repr(self.radius * a)
                   for a in ((1, 1, 3) if axes else (1,))]))
        path.write_text("\n".join(lines) + "\n")
        return path


def wipe(model, output):
    """A copy without translations and points."""
    output.mkdir()
    for path in model.glob("*.txt"):
        lines = path.read_text().splitlines()
        if path.name == "points3D.txt":
            lines = [line if line.startswith("#") else " ".join(
                line.split()[:1] + ["0", "0", "0"] + line.split()[4:])
                     for line in lines]
        if path.name == "images.txt":
            head = [n for n, line in enumerate(lines)
                    if not line.startswith("#")][0::2]
            for n in head:
                words = lines[n].split()
                words[5:8] = "0", "0", "0"
                lines[n] = " ".join(words)
        (output / path.name).write_text("\n".join(lines) + "\n")
    return output


class Runs:
    def __init__(self, krot, folder):
        self.krot = krot
        self.folder = folder

    def solve(self, what, model, *options):
        """Prints a row; returns the maximum, if there is one."""
        names = {key: self.folder / key for key in ("output", "report.json",
                                                     "proof.json")}
        names["report.json"].unlink(missing_ok=True)
        names["proof.json"].unlink(missing_ok=True)
        start = time.monotonic()
        done = subprocess.run(
            [self.krot, "solver", "--input_path", model, "--output_path",
             names["output"], "--overwrite", "1", "--output_type", "TXT",
             "--report_path", names["report.json"], "--certificate_path",
             names["proof.json"], "--log_level", "0", *map(str, options)],
            capture_output=True, text=True, check=False)
        seconds = time.monotonic() - start
        check = subprocess.run(
            [self.krot, "certificate_checker", "--input_path", model,
             "--certificate_path", names["proof.json"], "--log_level", "0"],
            capture_output=True, text=True, check=False)
        proof = "holds" if check.returncode == 0 else "REFUSED"
        if done.returncode != 0:
            said = done.stderr.strip().removeprefix("krot solver: ")
            print(f"{what:44} {said}; {proof} {seconds:.1f}", flush=True)
            return None
        report = json.loads(names["report.json"].read_text())
        factor = report["positions"]["factor"]
        words = ("" if factor is None else
                 f"  radii times {factor['value']:.4f}, more than "
                 f"{factor['lower_bound']:.4f}")
        print(f"{what:44} {report['cost_final']:9.4f} "
              f"{report['lower_bound']:9.4f} {len(report['rounds']):6} "
              f"{seconds:7.1f}  {proof}{words}", flush=True)
        return report["cost_final"]


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    krot, model = sys.argv[1], pathlib.Path(sys.argv[2])
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        runs = Runs(krot, folder)
        print(f"{'':44} {'maximum':>9} {'proved':>9} {'rounds':>6} {'s':>7}  "
              "proof")
        free = runs.solve("nothing else is known", model)
        best = folder / "best"
        (folder / "output").rename(best)
        survey = Survey(best)
        some = dict(list(survey.points.items())[::200])
        fixed = folder / "fixed.txt"
        fixed.write_text("\n".join(list(survey.cameras)[:NUM_FIXED]) + "\n")
        wiped = wipe(best, folder / "wiped")
        middle = list(survey.cameras)[len(survey.cameras) // 2]

        def positions(places, **how):
            return survey.write(folder / "positions.txt", places, **how)

        runs.solve("wiped", wiped)
        runs.solve(f"{NUM_FIXED} cameras fixed", best, "--fixed_images_path",
                   fixed)
        runs.solve("balls around all cameras", model, "--positions_path",
                   positions(survey.cameras, off=0.5))
        runs.solve("the same, wiped", wiped, "--positions_path",
                   folder / "positions.txt")
        runs.solve("ellipsoids around all cameras", model, "--positions_path",
                   positions(survey.cameras, off=0.5, axes=True))
        runs.solve("balls around every 200th point", model,
                   "--point_positions_path", positions(some, off=0.5))
        runs.solve("the same, 1.2 radii off", model,
                   "--point_positions_path", positions(some, off=1.2))
        runs.solve(f"one camera's ball wrong ({middle})", model,
                   "--positions_path",
                   positions(survey.cameras, wrong=middle))
        held = runs.solve("all cameras' balls 1.2 radii off", model,
                          "--positions_path",
                          positions(survey.cameras, off=1.2))
        runs.solve("the same, half of that undone by a factor", model,
                   "--positions_path", folder / "positions.txt",
                   "--Problem.inflate_positions", (free + held) / 2)


if __name__ == "__main__":
    main()
