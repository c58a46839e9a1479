#!/usr/bin/env python3
"""What krot point_triangulator --database_path and COLMAP's make of the same matches.

Usage: match_tracks.py KROT MODEL DATABASE [SCENE]

Prints for both the points, observations, observations within 2 px, of an image one of each track,
the mean track length, the root mean square error, and seconds of processor time. With SCENE,
tools/sample/scene.pov, MODEL is the ground truth of its cameras, and the distances of the points
from the surfaces that were rendered are printed: of 50 and of 90 % at most, millimetres, and how
many are farther than 5 cm. Needs colmap; cameras are PINHOLE, SIMPLE_PINHOLE, SIMPLE_RADIAL or
RADIAL.
"""

import math
import os
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import tempfile


def lines(path):
    with open(path, encoding="utf-8", errors="surrogateescape") as file:
        return [line for line in file.read().split("\n") if not line.startswith("#")]


def project(camera, x):
    model, f = camera[1], [float(word) for word in camera[4:]]
    u, v = x[0] / x[2], x[1] / x[2]
    if model == "PINHOLE":
        return f[0] * u + f[2], f[1] * v + f[3]
    radial = f[3:] if model in ("SIMPLE_RADIAL", "RADIAL") else []
    square = u * u + v * v
    scale = 1 + sum(k * square ** (n + 1) for n, k in enumerate(radial))
    return f[0] * scale * u + f[1], f[0] * scale * v + f[2]


def rotate(q, x):
    w, a = q[0], q[1:]
    cross = [a[1] * x[2] - a[2] * x[1], a[2] * x[0] - a[0] * x[2], a[0] * x[1] - a[1] * x[0]]
    twice = [a[1] * cross[2] - a[2] * cross[1], a[2] * cross[0] - a[0] * cross[2],
             a[0] * cross[1] - a[1] * cross[0]]
    return [x[i] + 2 * (w * cross[i] + twice[i]) for i in range(3)]


def boxes(scene):
    """Centre, half sizes and turn about y of the scene's boxes, in its own axes (y up)."""
    number = r"\s*(-?[\d.]+)\s*"
    pattern = rf"^Textured_box\({number},{number},\s*<{number},{number},{number}>,{number},"
    found = []
    for words in re.findall(pattern, pathlib.Path(scene).read_text(), re.MULTILINE):
        x, z, width, height, depth, turn = map(float, words)
        found.append(((x, height / 2, z), (width / 2, height / 2, depth / 2),
                      math.radians(turn)))
    return found


def distance(point, solids):
    """Of a point of the ground truth (y down) from the floor or the nearest box's surface."""
    x, y, z = point[0], -point[1], point[2]
    nearest = abs(y)
    for centre, half, turn in solids:
        u, v, w = x - centre[0], y - centre[1], z - centre[2]
        own = (u * math.cos(turn) - w * math.sin(turn), v, u * math.sin(turn) + w * math.cos(turn))
        beyond = [abs(a) - b for a, b in zip(own, half)]
        outside = math.sqrt(sum(max(0, b) ** 2 for b in beyond))
        nearest = min(nearest, outside if outside > 0 else -max(beyond))
    return nearest


def describe_surface(folder, scene):
    solids = boxes(scene)
    distances = sorted(
        distance([float(word) for word in line.split()[1:4]], solids)
        for line in lines(folder / "points3D.txt") if line)
    far = sum(value > 0.05 for value in distances)
    return (f" | {1000 * distances[len(distances) // 2]:.2f} | "
            f"{1000 * distances[9 * len(distances) // 10]:.2f} | {far}")


def describe(folder):
    cameras = {line.split()[0]: line.split() for line in lines(folder / "cameras.txt") if line}
    points = {words[0]: [float(word) for word in words[1:4]]
              for words in (line.split() for line in lines(folder / "points3D.txt")) if words}
    rows = lines(folder / "images.txt")
    errors = []
    within = 0
    for pose, pixels in zip(rows[::2], rows[1::2]):
        words = pose.split()
        q = [float(word) for word in words[1:5]]
        t = [float(word) for word in words[5:8]]
        values = pixels.split()
        seen = set()
        for x, y, point in zip(values[::3], values[1::3], values[2::3]):
            if point == "-1":
                continue
            turned = rotate(q, points[point])
            pixel = project(cameras[words[8]], [turned[i] + t[i] for i in range(3)])
            errors.append(math.hypot(pixel[0] - float(x), pixel[1] - float(y)))
            if errors[-1] <= 2:
                seen.add(point)
        within += len(seen)
    rms = math.sqrt(sum(error * error for error in errors) / max(1, len(errors)))
    return f"{len(points)} | {len(errors)} | {within} | {len(errors) / len(points):.3f} | {rms:.3f}"


def main(krot, model, database, scene=None):
    print("program | points | observations | within 2 px | mean track | RMS, px | processor, s" +
          (" | surface 50 %, mm | 90 % | above 50" if scene else ""))
    environment = dict(os.environ, QT_QPA_PLATFORM="offscreen")
    for name, program in (("krot", krot), ("colmap", "colmap")):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "images").mkdir()
            (root / "out").mkdir()
            (root / "text").mkdir()
            shutil.copy(database, root / "database.db")
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([program, "point_triangulator", "--database_path", root / "database.db",
                            "--image_path", root / "images", "--input_path", model,
                            "--output_path", root / "out", "--clear_points", "1"],
                           check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                           env=environment)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            subprocess.run(["colmap", "model_converter", "--input_path", root / "out",
                            "--output_path", root / "text", "--output_type", "TXT"],
                           check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                           env=environment)
            surface = describe_surface(root / "text", scene) if scene else ""
            print(f"{name} | {describe(root / 'text')} | {seconds:.2f}{surface}", flush=True)


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    main(*sys.argv[1:])
