#!/usr/bin/env python3
"""What `krot model_checker` says of rigs of which a part is wrong.

    planted_rigs.py KROT [SEEDS]

Makes scenes by `krot model_synthesizer` with half a pixel of noise: "orbit", 30
frames of a rig of three cameras 10 degrees apart, and "street", 20 of one of
five cameras 37 degrees apart with a tenth of the observations wrong. In SEEDS
(10) of each

* the frame in the middle is turned about its centre, turned about the middle
  of the scene, or moved by so much of the viewing distance: prints how many of the images of that frame are called
  wrong, and how many others;
* sensors, or frames, or both, are written as by each of 384 programs (see
  planted_conventions.py), or the rig in another unit: prints how many are
  found, so that what is left of the errors is as before.
"""

import itertools
import json
import math
import pathlib
import random
import sys
import tempfile

from planted_conventions import applied, axis_rotations, written
from planted_faults import multiply, rotation, run

SCENES = {
    "orbit": (3, "--Scene.num_frames", 30, "--Scene.num_points", 2000),
    "street": (5, "--Scene.layout", "street", "--Scene.num_points", 3000,
               "--Scene.rig_rotation_deg", 37, "--Scene.rig_baseline", 0.05,
               "--Scene.outlier_ratio", 0.1),
}


def lines(path):
    return [line.split() for line in path.read_text().splitlines()
            if line and not line.startswith("#")]


class Rigs:
    """The one rig and the frames of a folder; poses are seven numbers."""

    def __init__(self, folder):
        self.folder = folder
        (self.rig,) = lines(folder / "rigs.txt")
        self.frames = lines(folder / "frames.txt")

    def change_sensors(self, change):
        for i in range(4, len(self.rig), 10):
            self.rig[i + 3:i + 10] = change(list(map(float, self.rig[i + 3:i + 10])))

    def change_frames(self, change, only=None):
        for frame in self.frames if only is None else [self.frames[only]]:
            frame[2:9] = change(list(map(float, frame[2:9])))

    def write(self):
        for name, rows in (("rigs", [self.rig]), ("frames", self.frames)):
            (self.folder / f"{name}.txt").write_text(
                "".join(" ".join(map(str, row)) + "\n" for row in rows))


def random_direction(rng):
    v = [rng.gauss(0, 1) for _ in range(3)]
    return [x / math.hypot(*v) for x in v]


def turned(degrees, axis, is_about_scene=False):
    half = math.radians(degrees) / 2
    turn = [math.cos(half), *(math.sin(half) * x for x in axis)]

    def change(pose):
        t = pose[4:] if is_about_scene else applied(rotation(*turn), pose[4:])
        return list(multiply(turn, pose[:4])) + t
    return change


def moved(step):
    def change(pose):
        shift = applied(rotation(*pose[:4]), step)
        return pose[:4] + [t - s for t, s in zip(pose[4:], shift)]
    return change


def longer(factor):
    return lambda pose: pose[:4] + [factor * t for t in pose[4:]]


def by_program(program, is_sensor):
    def change(pose):
        # A rig has the axes of its cameras.
        if is_sensor:
            back = [program[4][0], *(-v for v in program[4][1:])]
            pose = list(multiply(pose[:4], back)) + pose[4:]
        return written(pose, *program)
    return change


class Scene:
    def __init__(self, krot, folder, name, seed):
        sensors, *options = SCENES[name]
        self.krot, self.folder = krot, folder
        self.options = (*options, "--Scene.sensors_per_rig", sensors,
                        "--Scene.pixel_noise", 0.5, "--Scene.camera_model",
                        "PINHOLE", "--random_seed", seed)

    def report(self, change):
        model = self.folder / "model"
        run(self.krot, "model_synthesizer", "--output_path", model, "--output_type",
            "TXT", "--overwrite", 1, *self.options)
        rigs = Rigs(model)
        change(rigs)
        rigs.write()
        run(self.krot, "model_checker", "--input_path", model, "--report_path",
            self.folder / "report.json")
        return json.loads((self.folder / "report.json").read_text())


def frames_row(krot, folder, name, seeds, words, change_of):
    found, others = 0, 0
    for seed in range(seeds):
        rng = random.Random(seed)
        report = Scene(krot, folder, name, seed).report(
            lambda rigs: rigs.change_frames(change_of(rng), len(rigs.frames) // 2))
        middle = report["num_images"] // SCENES[name][0] // 2 + 1
        for image in report["images"]:
            if image["verdict"] == "wrong":
                is_planted = f"frame{middle:06}" in image["image_name"]
                found += is_planted
                others += not is_planted
    print(f"| {name} | {words} | {seeds * SCENES[name][0]} | {found} | {others} |",
          flush=True)


def conventions_row(krot, folder, name, words, changes):
    found, tried = 0, 0
    scene = Scene(krot, folder, name, 1)
    before = scene.report(lambda rigs: None)["sigma_px"]
    for change in changes:
        report = scene.report(change)
        tried += 1
        found += (report["conventions"] is not None
                  and abs(report["sigma_px"] / before - 1) < 0.01)
    print(f"| {name} | {words} | {tried} | {found} |", flush=True)


def written_by(program, has_sensors, has_frames):
    def change(rigs):
        if has_sensors:
            rigs.change_sensors(by_program(program, True))
        if has_frames:
            rigs.change_frames(by_program(program, False))
    return change


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    krot = pathlib.Path(sys.argv[1])
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 10
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        print("| scene | one frame | its images | called wrong | others called wrong |\n"
              "|---|---|---|---|---|")
        for scene in SCENES:
            for degrees in (0.1, 0.2, 0.5, 1, 2, 5):
                frames_row(krot, folder, scene, seeds, f"turned by {degrees}°",
                           lambda rng, d=degrees: turned(d, random_direction(rng)))
                frames_row(krot, folder, scene, seeds,
                           f"turned by {degrees}° about the scene",
                           lambda rng, d=degrees: turned(d, random_direction(rng), True))
            for percent in (0.2, 0.5, 1, 5):
                frames_row(krot, folder, scene, seeds, f"moved by {percent} %",
                           lambda rng, p=percent: moved(
                               [p / 100 * x for x in random_direction(rng)]))
        print("\n| scene | written as by other programs | programs | found |\n"
              "|---|---|---|---|")
        # A left-handed program mirrors the points as well.
        programs = [program for program in itertools.product(
            *[(False, True)] * 3, (False,), axis_rotations())
            if any(program[:3]) or abs(program[4][0]) < 1]
        for scene in SCENES:
            for words, which in (("sensors", (True, False)), ("frames", (False, True)),
                                 ("both", (True, True))):
                conventions_row(krot, folder, scene, words,
                                [written_by(program, *which) for program in programs])
            conventions_row(krot, folder, scene, "unit of the rig", [
                lambda rigs, f=f: rigs.change_sensors(longer(f))
                for f in (0.001, 0.01, 0.1, 3, 10, 40, 1000)])


if __name__ == "__main__":
    main()
