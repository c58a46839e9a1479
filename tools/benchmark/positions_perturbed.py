#!/usr/bin/env python3
"""Positions from nothing where rotations and observations are wrong.

    positions_perturbed.py KROT BENCHMARK [DRAWS [NAME=MODEL=TRUTH ...]]

Takes scenes with weak overlap, which `krot model_synthesizer` makes, and every
model named (binary, of sensors that are their rigs' references), removes their
positions, and in DRAWS (5) draws each either moves 10, 20, 30 or 40 % of the
observations to random pixels or turns a fifth of the images by 1, 3 or 10
degrees about random axes. `krot solver --Solver.init feasible` then finds the
positions without being told a bound, and so does the rival of bearings
(`krot_benchmark positioning`). Prints the RMS distance of the camera centres
from the truth after the similarity that fits best, as a percentage of their
radius: the median and the worst of the draws, and of those draws that ended
with exit code 0 the worst. The Python standard library is enough.
"""

import json
import math
import pathlib
import random
import shutil
import statistics
import struct
import subprocess
import sys
import tempfile

SCENES = {
    "street of 30, tracks of 3": ("street", 30, 1800, 3),
    "loop of 30, tracks of 3": ("orbit", 30, 1800, 3),
    "loop of 30, tracks of 6": ("orbit", 30, 1800, 6),
}
FAULTS = ([("wrong", share) for share in (0.1, 0.2, 0.3, 0.4)]
          + [("turned", degrees) for degrees in (1, 3, 10)])


def run(*command):
    return subprocess.run([str(word) for word in command], check=False,
                          stdout=subprocess.DEVNULL,
                          stderr=subprocess.DEVNULL).returncode


def times(q, r):
    """The product of two quaternions w x y z."""
    a, b, c, d = q
    e, f, g, h = r
    return (a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e)


def turn(degrees, rng):
    axis = [rng.gauss(0, 1) for _ in range(3)]
    scale = math.sin(math.radians(degrees) / 2) / math.hypot(*axis)
    return (math.cos(math.radians(degrees) / 2), *(scale * v for v in axis))


def perturb(model, output, fault, size, rng):
    """A copy without positions."""
    shutil.rmtree(output, ignore_errors=True)
    shutil.copytree(model, output)
    data = bytearray((output / "images.bin").read_bytes())
    heads, pixels, end = {}, [], 8
    for _ in range(struct.unpack_from("<Q", data)[0]):
        image = struct.unpack_from("<I", data, end)[0]
        heads[image] = end + 4
        end = data.index(0, end + 64) + 1
        count = struct.unpack_from("<Q", data, end)[0]
        for place in range(end + 8, end + 8 + 24 * count, 24):
            if struct.unpack_from("<q", data, place + 16)[0] != -1:
                pixels.append(place)
        end += 8 + 24 * count
    turns = {}
    if fault == "turned":
        chosen = rng.sample(sorted(heads), max(1, len(heads) // 5))
        turns = {image: turn(size, rng) for image in chosen}
    else:
        width = max(struct.unpack_from("<d", data, p)[0] for p in pixels)
        height = max(struct.unpack_from("<d", data, p + 8)[0] for p in pixels)
        for place in rng.sample(pixels, int(size * len(pixels))):
            struct.pack_into("<2d", data, place, rng.uniform(0, width),
                             rng.uniform(0, height))

    def pose(buffer, place, image):
        q = struct.unpack_from("<4d", buffer, place)
        struct.pack_into("<7d", buffer, place,
                         *times(turns.get(image, (1, 0, 0, 0)), q),
                         *[math.nan] * 3)

    for image, place in heads.items():
        pose(data, place, image)
    (output / "images.bin").write_bytes(data)
    if not (output / "frames.bin").exists():
        return
    frames = bytearray((output / "frames.bin").read_bytes())
    place = 8
    for _ in range(struct.unpack_from("<Q", frames)[0]):
        count = struct.unpack_from("<I", frames, place + 64)[0]
        pose(frames, place + 8, struct.unpack_from("<Q", frames, place + 76)[0])
        place += 68 + 16 * count
    (output / "frames.bin").write_bytes(frames)


def centres(krot, truth, model, folder):
    report = folder / "compared.json"
    report.unlink(missing_ok=True)
    run(krot, "model_comparer", "--input_path1", truth, "--input_path2", model,
        "--alignment", "similarity", "--report_path", report)
    if not report.exists():
        return math.inf
    compared = json.loads(report.read_text())
    return 100 * compared["center"]["rms"] / compared["scene_radius"]


def draw(krot, benchmark, folder, model, truth):
    """KROT's error and exit code, the rival's error."""
    for name in ("krot", "rival"):
        shutil.rmtree(folder / name, ignore_errors=True)
    code = run(krot, "solver", "--input_path", model, "--output_path",
               folder / "krot", "--Solver.init", "feasible")
    run(benchmark, "positioning", "--input_path", model, "--output_path",
        folder / "rival")
    return (centres(krot, truth, folder / "krot", folder), code,
            centres(krot, truth, folder / "rival", folder))


def table(krot, benchmark, draws, name, model, truth, folder):
    for fault, size in FAULTS:
        own, trusted, rival = [], [], []
        for seed in range(draws):
            perturb(model, folder / "raw", fault, size, random.Random(seed))
            error, code, other = draw(krot, benchmark, folder, folder / "raw",
                                      truth)
            own.append(error)
            rival.append(other)
            if code == 0:
                trusted.append(error)
        said = (f"{size:.0%} wrong" if fault == "wrong"
                else f"a fifth turned by {size}°")
        print(f"| {name} | {said} | {statistics.median(own):.2f} | "
              f"{max(own):.2f} | {len(trusted)} | "
              f"{max(trusted, default=math.nan):.2f} | "
              f"{statistics.median(rival):.2f} | {max(rival):.2f} |",
              flush=True)


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    krot, benchmark = sys.argv[1:3]
    draws = int(sys.argv[3]) if len(sys.argv) > 3 else 5
    print("| model | fault | KROT, median | worst | code 0 | worst of these "
          "| rival, median | worst |\n|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        for name, (layout, frames, points, length) in SCENES.items():
            run(krot, "model_synthesizer", "--output_path", folder / "scene",
                "--ground_truth_path", folder / "truth", "--overwrite", 1,
                "--Scene.layout", layout, "--Scene.num_frames", frames,
                "--Scene.num_points", points, "--Scene.track_length", length,
                "--Scene.camera_model", "PINHOLE", "--Scene.pixel_noise", 1)
            table(krot, benchmark, draws, name, folder / "scene",
                  folder / "truth", folder)
        for named in sys.argv[4:]:
            name, model, truth = named.split("=")
            table(krot, benchmark, draws, name, pathlib.Path(model),
                  pathlib.Path(truth), folder)


if __name__ == "__main__":
    main()
