#!/usr/bin/env python3
"""Which of planted outliers `krot outlier_filter` removes, and what it proves.

    outlier_recall.py KROT [SEEDS]

Scenes of 20 images, 1000 points and 6000 observations with half a pixel of
noise, of which 0.1, 1, 5 and 10 % are moved: by 10 to 500 px in any direction
(uniform), the same but in as few images as half of their observations allow
(clustered), or two of an image exchanged (swapped). The bound is 3 px; means
over SEEDS scenes (3). `recall > 4` is of those moved by more than four bounds,
`precision` counts as right what was moved by more than one. Planted is above
what is proved, or the row says so.
"""

import csv
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile

BOUND = 3.0
RATIOS = (0.001, 0.01, 0.05, 0.1)
KINDS = ("uniform", "clustered", "swapped")


def run(krot, *arguments):
    done = subprocess.run([krot, *map(str, arguments), "--log_level", "0"],
                          capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, arguments))}: {done.stderr}")


class Images:
    """images.txt: [line of the pose, [x, y, point3D_id, ...]] per image."""

    def __init__(self, path):
        self.path = path
        lines = [l for l in path.read_text().splitlines()
                 if not l.startswith("#")]
        self.poses = lines[0::2]
        self.points = [l.split() for l in lines[1::2]]
        self.ids = [int(l.split()[0]) for l in self.poses]

    def observations(self):
        return [(n, i) for n, row in enumerate(self.points)
                for i in range(len(row) // 3) if row[3 * i + 2] != "-1"]

    def get(self, o):
        row = self.points[o[0]]
        return float(row[3 * o[1]]), float(row[3 * o[1] + 1])

    def set(self, o, xy):
        row = self.points[o[0]]
        row[3 * o[1]], row[3 * o[1] + 1] = map(repr, xy)

    def write(self):
        text = "".join(f"{pose}\n{' '.join(row)}\n"
                       for pose, row in zip(self.poses, self.points))
        self.path.write_text(text)


def move(images, chosen, rng):
    """Moves them by 10 to 500 px; their lengths by observation."""
    moved = {}
    for o in chosen:
        length = rng.uniform(10, 500)
        angle = rng.uniform(0, 2 * math.pi)
        x, y = images.get(o)
        images.set(o, (x + length * math.cos(angle),
                       y + length * math.sin(angle)))
        moved[o] = length
    return moved


def swap(images, everything, count, rng):
    moved = {}
    order = list(everything)
    rng.shuffle(order)
    waiting = {}
    for o in order:
        if len(moved) + 2 > max(2, count):
            break
        other = waiting.pop(o[0], None)
        if other is None:
            waiting[o[0]] = o
            continue
        a, b = images.get(o), images.get(other)
        images.set(o, b)
        images.set(other, a)
        moved[o] = moved[other] = math.dist(a, b)
    return moved


def plant(images, kind, ratio, rng):
    everything = images.observations()
    count = max(1, round(ratio * len(everything)))
    if kind == "swapped":
        return swap(images, everything, count, rng)
    if kind == "uniform":
        return move(images, rng.sample(everything, count), rng)
    chosen = []
    for n in rng.sample(range(len(images.points)), len(images.points)):
        own = [o for o in everything if o[0] == n]
        chosen += rng.sample(own, min(count - len(chosen), len(own) // 2))
    return move(images, chosen, rng)


def trial(krot, kind, ratio, seed):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        run(krot, "model_synthesizer", "--output_path", folder / "scene",
            "--output_type", "TXT", "--Scene.num_frames", 20,
            "--Scene.num_points", 1000, "--Scene.track_length", 6,
            "--Scene.camera_model", "PINHOLE", "--Scene.pixel_noise", 0.5,
            "--random_seed", seed)
        images = Images(folder / "scene" / "images.txt")
        moved = plant(images, kind, ratio, random.Random(seed))
        images.write()
        run(krot, "outlier_filter", "--input_path", folder / "scene",
            "--output_path", folder / "out", "--OutlierFilter.max_error",
            BOUND, "--outliers_path", folder / "o.csv", "--report_path",
            folder / "r.json")
        index = {image: n for n, image in enumerate(images.ids)}
        with open(folder / "o.csv", encoding="utf-8") as lines:
            removed = {(index[int(row["image_id"])], int(row["point2D_idx"]))
                       for row in csv.DictReader(lines)}
        must = json.loads((folder / "r.json").read_text())["num_must_go"]
    far = {o for o, length in moved.items() if length > 4 * BOUND}
    wrong = {o for o, length in moved.items() if length > BOUND}
    return {"planted": len(moved), "removed": len(removed), "must": must,
            "recall": len(far & removed) / max(1, len(far)),
            "precision": len(wrong & removed) / max(1, len(removed)),
            "state": "" if must <= len(moved) else "PROVED TOO MANY"}


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    print("| planted | share | number | removed | proved | recall > 4 | "
          "precision |\n|---|---|---|---|---|---|---|")
    for kind in KINDS:
        for ratio in RATIOS:
            rows = [trial(sys.argv[1], kind, ratio, seed)
                    for seed in range(1, seeds + 1)]
            mean = {key: sum(row[key] for row in rows) / len(rows)
                    for key in rows[0] if key != "state"}
            state = max(row["state"] for row in rows)
            print(f"| {kind} | {100 * ratio:g} % | {mean['planted']:.1f} | "
                  f"{mean['removed']:.1f} | {mean['must']:.1f} | "
                  f"{mean['recall']:.4f} | {mean['precision']:.4f} | "
                  f"{state}".rstrip(" |") + " |", flush=True)


if __name__ == "__main__":
    main()
