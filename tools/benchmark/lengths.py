#!/usr/bin/env python3
"""Whether proved lengths hold the truth, in random scenes.

    lengths.py KROT [SCENES]

Makes SCENES (1,000) random scenes of 6 frames and 40 points with noise of
0.5 px, half of them with lenses or rigs. `krot tolerance_analyzer` gets the
largest error that the truth has for its bound, and a scale bar between two
cameras, 50 m for a unit, off by less than its tolerance of 1 cm; asked for are
the lengths between two cameras, two points, and a camera and a point. Prints
how many are proved, how many of these hold the truth, and how far apart the
ends are, relative to the length: the median and the nine tenths.
"""

import json
import math
import pathlib
import random
import statistics
import subprocess
import sys
import tempfile

from own_positions import METRES_PER_UNIT, centres

LENSES = ("PINHOLE", "SIMPLE_RADIAL", "OPENCV")


def scene(krot, folder, seed):
    """Yields the proved ends and the true length, metres, of each length."""
    draw = random.Random(seed)

    def run(*arguments):
        subprocess.run([krot, *map(str, arguments), "--log_level", "0"],
                       check=True, stdout=subprocess.DEVNULL)

    run("model_synthesizer", "--output_path", folder / "scene",
        "--ground_truth_path", folder / "truth", "--output_type", "TXT",
        "--Scene.num_frames", 6, "--Scene.num_points", 40,
        "--Scene.track_length", 4, "--Scene.pixel_noise", 0.5,
        "--Scene.camera_model", LENSES[seed % 3], "--Scene.sensors_per_rig",
        2 if seed % 4 == 0 else 1, "--random_seed", seed)
    run("model_analyzer", "--path", folder / "truth", "--report_path",
        folder / "truth.json")
    largest = json.loads((folder / "truth.json").read_text())[
        "pixel_error"]["max"]
    places = centres(folder / "truth")
    cameras = draw.sample(sorted(places), 4)
    for line in (folder / "truth" / "points3D.txt").read_text().splitlines():
        if not line.startswith("#"):
            places[line.split()[0]] = list(map(float, line.split()[1:4]))
    points = draw.sample(sorted(set(places) - set(centres(folder / "truth"))),
                         3)
    pairs = [cameras[:2], cameras[2:], points[:2], [cameras[2], points[2]]]

    def metres(pair):
        return METRES_PER_UNIT * math.dist(places[pair[0]], places[pair[1]])

    bar = metres(pairs[0]) + draw.uniform(-0.01, 0.01)
    (folder / "bars.txt").write_text(
        f"{pairs[0][0]} {pairs[0][1]} {bar!r} 0.01\n"
        + "".join(f"{a} {b}\n" for a, b in pairs[1:]))
    run("tolerance_analyzer", "--input_path", folder / "scene",
        "--ToleranceAnalyzer.max_error", repr(1.0001 * largest),
        "--ToleranceAnalyzer.distances", folder / "bars.txt", "--report_path",
        folder / "report.json")
    report = json.loads((folder / "report.json").read_text())
    for length, pair in zip(report["lengths"][1:], pairs[1:]):
        yield (length["low"]["proved"], length["high"]["proved"], metres(pair))


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    num_scenes = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    num_lengths = num_held = 0
    widths = []
    for seed in range(1, num_scenes + 1):
        with tempfile.TemporaryDirectory() as folder:
            for low, high, truth in scene(sys.argv[1], pathlib.Path(folder),
                                          seed):
                num_lengths += 1
                if low is None or high is None:
                    continue
                if low <= truth <= high:
                    num_held += 1
                else:
                    print(f"seed {seed}: {truth} is not in [{low}, {high}]")
                widths.append((high - low) / truth)
    widths.sort()
    print(f"{num_scenes} scenes, {num_lengths} lengths, {len(widths)} proved, "
          f"of which {num_held} hold the truth; the ends are "
          f"{100 * statistics.median(widths):.1f} % apart (median), "
          f"{100 * widths[9 * len(widths) // 10]:.1f} % (nine tenths)")


if __name__ == "__main__":
    main()
