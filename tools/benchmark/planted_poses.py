#!/usr/bin/env python3
"""How often krot model_checker --database_path finds images whose pose is wrong.

Usage: planted_poses.py KROT MODEL DATABASE [SEEDS]

MODEL, without rigs, is one whose poses are right. In copies of it 1, 3 or 5 images are turned
about their centres by an angle, or moved by a share of the cameras' radius, in random directions.
Prints for each kind how many the matches called wrong of how many, of how many the rotation was
proved wrong, how many other images were called wrong by anything, of how many of those found it was
said rightly whether they were turned or moved, and by how much in the median, against the truth.
Needs colmap.
"""

import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile

KINDS = [("turned, degrees", size) for size in (0.1, 0.3, 1, 5)] + [
    ("moved, % of the radius", size) for size in (1, 3, 10, 20)]


def times(q, r):
    """The product of two quaternions w x y z."""
    a, b, c, d = q
    e, f, g, h = r
    return [a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e]


def rotate(q, x):
    return times(times(q, [0, *x]), [q[0], -q[1], -q[2], -q[3]])[1:]


def center(words):
    q = [float(word) for word in words[1:5]]
    t = [float(word) for word in words[5:8]]
    return [-value for value in rotate([q[0], -q[1], -q[2], -q[3]], t)]


def direction():
    axis = [random.gauss(0, 1) for _ in range(3)]
    length = math.sqrt(sum(value * value for value in axis))
    return [value / length for value in axis]


def changed(line, kind, size, radius):
    words = line.split()
    q = [float(word) for word in words[1:5]]
    place = center(words)
    axis = direction()
    if kind.startswith("turned"):
        half = math.radians(size) / 2
        q = times([math.cos(half)] + [math.sin(half) * x for x in axis], q)
    else:
        place = [c + size / 100 * radius * x for c, x in zip(place, axis)]
    t = [-value for value in rotate(q, place)]
    return " ".join([words[0], *map(repr, q + t), *words[8:]])


def analyze(krot, model, database):
    report = model / "report.json"
    subprocess.run([krot, "model_checker", "--input_path", model, "--database_path",
                    database, "--report_path", report, "--log_level", "0"],
                   check=True, stdout=subprocess.DEVNULL)
    return json.loads(report.read_text())


def main(krot, model, database, seeds=20):
    with tempfile.TemporaryDirectory() as folder:
        text = pathlib.Path(folder)
        subprocess.run(["colmap", "model_converter", "--input_path", model, "--output_path",
                        folder, "--output_type", "TXT"], check=True, stdout=subprocess.DEVNULL)
        lines = (text / "images.txt").read_text().splitlines()
        first = next(i for i, line in enumerate(lines) if not line.startswith("#"))
        poses = range(first, len(lines), 2)
        centers = [center(lines[i].split()) for i in poses]
        mean = [sum(axis) / len(centers) for axis in zip(*centers)]
        radius = math.sqrt(sum(math.dist(c, mean) ** 2 for c in centers) / len(centers))
        clean = analyze(krot, text, database)
        print(f"as it is: {clean['verdict']} {clean['database']['verdict']}")
        print("planted | images | found | rotation proved wrong | others called wrong | "
              "fault told | by")
        for kind, size in KINDS:
            for count in (1, 3, 5):
                planted = found = proved = others = told = 0
                sizes = []
                for seed in range(int(seeds)):
                    random.seed(f"{kind} {size} {count} {seed}")
                    wrong = random.sample(poses, count)
                    copy = list(lines)
                    for i in wrong:
                        copy[i] = changed(lines[i], kind, size, radius)
                    (text / "images.txt").write_text("\n".join(copy) + "\n")
                    names = {lines[i].split(maxsplit=9)[9] for i in wrong}
                    planted += count
                    report = analyze(krot, text, database)
                    others += sum(image["verdict"] == "wrong" and image["image_name"] not in names
                                  for image in report["images"])
                    for image in report["database"]["images"]:
                        if image["image_name"] not in names:
                            continue
                        if not image["is_wrong"]:
                            continue
                        found += 1
                        proved += image["is_rotation_proved_wrong"]
                        fault = "rotation" if kind.startswith("turned") else "position"
                        if image["fault"] == fault:
                            told += 1
                            sizes.append(image["turned_by_deg"] if fault == "rotation" else
                                         100 * image["moved_by"] / radius)
                by = f"{sorted(sizes)[len(sizes) // 2]:.3f}" if sizes else "-"
                print(f"{size} {kind} | {count} | {found} of {planted} | {proved} | {others} | "
                      f"{told} of {found} | {by}", flush=True)


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    main(*sys.argv[1:])
