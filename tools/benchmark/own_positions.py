#!/usr/bin/env python3
"""Positions in a frame of their own, some of them wrong, against the truth.

    own_positions.py KROT [TOWNS [RADIUS ...]]

Makes TOWNS (20) random towns for each RADIUS (0.02, 0.1, 0.5, 2 and 5 m) and
each share of wrong positions (0, 10, 20, 30 and 40 %): 10 to 60 cameras, a
viewing distance of 50 m, noise of 0.5 px, adjusted. Positions are the true
centres, turned at will and shifted as far as UTM coordinates are, and off by a
third of the radius per axis (Gaussian, in the radius); wrong ones by another 10
to 1,000 m. A row has the share of the wrong ones that are named (recall), of
the named ones that are wrong (precision), the error of the scale, and the
distance of the written cameras (--output_frame own) from the truth, root mean
square, the median and the largest over the towns.
"""

import json
import math
import pathlib
import random
import statistics
import subprocess
import sys
import tempfile

METRES_PER_UNIT = 50
SHARES = (0, 0.1, 0.2, 0.3, 0.4)
RADII = (0.02, 0.1, 0.5, 2, 5)


def rotation(w, x, y, z):
    norm = math.hypot(w, x, y, z)
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    return ((1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)))


def centres(model):
    """-R't of every image of a model in text form, by name."""
    lines = [line for line in (model / "images.txt").read_text().splitlines()
             if not line.startswith("#")][0::2]
    found = {}
    for words in map(str.split, lines):
        R = rotation(*map(float, words[1:5]))
        t = list(map(float, words[5:8]))
        found[words[9]] = [-sum(R[k][axis] * t[k] for k in range(3))
                           for axis in range(3)]
    return found


class Town:
    def __init__(self, krot, folder, seed):
        self.krot, self.folder = krot, folder
        self.draw = random.Random(seed)
        self.run("model_synthesizer", "--output_path", folder / "scene",
                 "--ground_truth_path", folder / "truth", "--overwrite", 1,
                 "--output_type", "TXT", "--Scene.num_frames",
                 self.draw.randint(10, 60), "--Scene.num_points", 400,
                 "--Scene.has_rigs", 0, "--Scene.pixel_noise", 0.5,
                 "--random_seed", seed)
        self.run("bundle_adjuster", "--input_path", folder / "scene",
                 "--output_path", folder / "adjusted", "--overwrite", 1)
        R = rotation(*(self.draw.gauss(0, 1) for _ in range(4)))
        origin = (454000 + self.draw.random(), 5412000 + self.draw.random(),
                  310 + self.draw.random())
        self.truth = {
            name: [METRES_PER_UNIT * sum(R[k][n] * c[n] for n in range(3))
                   + origin[k] for k in range(3)]
            for name, c in centres(folder / "truth").items()}

    def run(self, *arguments):
        subprocess.run([self.krot, *map(str, arguments), "--log_level", "0"],
                       check=True, stdout=subprocess.DEVNULL)

    def way(self, length):
        way = [self.draw.gauss(0, 1) for _ in range(3)]
        return [length * w / math.hypot(*way) for w in way]

    def positions(self, radius, share):
        """Writes them; returns the names of the wrong ones."""
        names = sorted(self.truth)
        wrong = set(self.draw.sample(names, round(share * len(names))))
        lines = []
        for name in names:
            off = [radius] * 3
            while math.hypot(*off) > radius:
                off = [self.draw.gauss(0, radius / 3) for _ in range(3)]
            if name in wrong:
                far = self.way(10 ** self.draw.uniform(1, 3))
                off = [a + b for a, b in zip(off, far)]
            lines.append(" ".join([name] + [repr(x + o) for x, o in
                                            zip(self.truth[name], off)]
                                  + [repr(radius)]))
        (self.folder / "positions.txt").write_text("\n".join(lines) + "\n")
        return wrong

    def solve(self):
        """Returns the report's part and the cameras' RMS distance."""
        report = self.folder / "report.json"
        self.run("solver", "--input_path", self.folder / "adjusted",
                 "--output_path", self.folder / "output", "--overwrite", 1,
                 "--positions_path", self.folder / "positions.txt",
                 "--positions_frame", "own", "--output_frame", "own",
                 "--Solver.relative_gap", 0.01, "--report_path", report)
        found = centres(self.folder / "output")
        squares = [math.dist(found[name], place)**2
                   for name, place in self.truth.items()]
        return (json.loads(report.read_text())["positions"]["frame"],
                math.sqrt(statistics.fmean(squares)))


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    num_towns = int(sys.argv[2]) if len(sys.argv) > 2 else 20
    radii = list(map(float, sys.argv[3:])) or RADII
    print("| radius, m | wrong, % | named of wrong | wrong of named | scale off,"
          " ppm (median, largest) | cameras off, m (median, largest) |")
    print("|---|---|---|---|---|---|")
    for radius in radii:
        for share in SHARES:
            num_wrong = num_named = num_both = 0
            scales, offs = [], []
            for seed in range(num_towns):
                with tempfile.TemporaryDirectory() as folder:
                    town = Town(sys.argv[1], pathlib.Path(folder), seed + 1)
                    wrong = town.positions(radius, share)
                    frame, off = town.solve()
                named = {entry["name"] for entry in frame["wrong"]}
                num_wrong += len(wrong)
                num_named += len(named)
                num_both += len(wrong & named)
                scales.append(1e6 * abs(frame["scale"] / METRES_PER_UNIT - 1))
                offs.append(off)
            print(f"| {radius:g} | {100 * share:g} | {num_both} of {num_wrong} "
                  f"| {num_both} of {num_named} "
                  f"| {statistics.median(scales):.0f}, {max(scales):.0f} "
                  f"| {statistics.median(offs):.3f}, {max(offs):.3f} |",
                  flush=True)


if __name__ == "__main__":
    main()
