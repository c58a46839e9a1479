#!/usr/bin/env python3
"""How many planted faults `krot model_checker` finds, and what else it calls
wrong, beside a look at mean errors and a threshold.

    planted_faults.py KROT [MODEL] [SEEDS] [WORD]

MODEL is a COLMAP model of pinholes or SIMPLE_RADIAL, RADIAL, OPENCV cameras (read
through `colmap model_converter`); without one, or with "-", scenes are made by
`krot model_synthesizer`: 30 images, noise of one pixel. For each fault (of those
with WORD in their name) SEEDS (10) trials are counted together; the table so far
is printed after each seed. The faults:

turned, shifted: three images (one in models of fewer than ten) are turned about
    their centres by so many degrees, or moved by so many per cent of the radius
    (RMS) of all centres, about any axis and in any direction. Their 2D points
    keep what COLMAP would let them keep: `adjusted`: the points move to their
    least squares and what is then 4 px and more off goes, twice (colmap
    bundle_adjuster with cameras held, and point_filtering); `nearest`: each sees
    the 3D point that the camera now puts nearest to it, if that is within 4 px.
moved: so many per cent of all observations are moved by so many sigma (as
    model_checker finds it) in any direction, and everything is adjusted (krot
    bundle_adjuster).
exchanged: one per cent of the observations change their points with another of
    their image, `near`: the nearest, and everything is adjusted.

Rivals call wrong: `mean`: an image whose mean error is more than twice the median
image's; `2 px`: an observation of more than 2 px, an image with more than half of
its observations above. What each calls wrong without the fault is not counted.
Planted images that keep fewer than ten observations are a column of their own:
little says that they are wrong, but nothing holds them either. Others that are
left with so few, as their tracks went with a planted one, are not counted: to
say that nothing holds them is no false alarm.
"""

import copy
import json
import math
import pathlib
import random
import statistics
import subprocess
import sys
import tempfile

TURNS = (0.2, 0.5, 1, 2, 5)
SHIFTS = (1, 5, 20)
MOVES = tuple((percent, sigmas) for percent in (0.1, 1, 10)
              for sigmas in (5, 10, 50))
LIMIT = 4.0
FEWEST = 10


def run(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True,
                          text=True, check=False,
                          env={"QT_QPA_PLATFORM": "offscreen", "PATH":
                               "/usr/local/bin:/usr/bin:/bin"})
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: {done.stderr}")


class Model:
    """A COLMAP text model: lists of words, and numbers where they are needed."""

    def __init__(self, folder):
        self.folder = folder
        self.camera_file = (folder / "cameras.txt").read_bytes()
        self.cameras = {}
        for row in self.rows("cameras.txt"):
            self.cameras[row[0]] = (row[1], [float(p) for p in row[4:]])
        self.images = {}  # id: [pose of 7 numbers, camera, name]
        self.points2D = {}  # id: [[x, y, point3D], ...]
        rows = self.rows("images.txt", skip_empty=False)
        for head, body in zip(rows[::2], rows[1::2]):
            self.images[head[0]] = [[float(v) for v in head[1:8]], head[8],
                                    " ".join(head[9:])]
            self.points2D[head[0]] = [
                [float(body[i]), float(body[i + 1]), body[i + 2]]
                for i in range(0, len(body), 3)]
        self.points3D = {row[0]: row[1:8] for row in self.rows("points3D.txt")}

    def rows(self, name, skip_empty=True):
        lines = (self.folder / name).read_text(errors="replace").split("\n")
        rows = [line.split() for line in lines if not line.startswith("#")]
        if skip_empty:
            return [row for row in rows if row]
        return rows[:len(rows) - len(rows) % 2]

    def write(self, folder):
        """Tracks are made of the images' 2D points; those of one go."""
        folder.mkdir(parents=True)
        (folder / "cameras.txt").write_bytes(self.camera_file)
        tracks = {}
        for image, points in self.points2D.items():
            for index, (_, _, point) in enumerate(points):
                if point != "-1":
                    tracks.setdefault(point, []).append((image, index))
        tracks = {p: t for p, t in tracks.items() if len(t) > 1}
        with open(folder / "images.txt", "w", encoding="utf-8") as out:
            for image, (pose, camera, name) in self.images.items():
                out.write(f"{image} {' '.join(map(repr, pose))} {camera} {name}"
                          "\n" + " ".join(
                              f"{x!r} {y!r} {p if p in tracks else -1}"
                              for x, y, p in self.points2D[image]) + "\n")
        with open(folder / "points3D.txt", "w", encoding="utf-8") as out:
            for point, track in tracks.items():
                out.write(" ".join([point, *self.points3D[point], *(
                    f"{image} {index}" for image, index in track)]) + "\n")

    def project(self, image, xyz):
        """The pixel, or None."""
        (qw, qx, qy, qz, *t), camera, _ = self.images[image]
        R = rotation(qw, qx, qy, qz)
        x, y, z = (sum(R[r][c] * xyz[c] for c in range(3)) + t[r]
                   for r in range(3))
        if z <= 0:
            return None
        u, v = x / z, y / z
        kind, p = self.cameras[camera]
        two = kind in ("PINHOLE", "OPENCV")
        fx, fy, cx, cy = p[:4] if two else (p[0], p[0], p[1], p[2])
        k = p[4:] if two else p[3:]
        r2 = u * u + v * v
        radial = 1 + sum(a * r2 ** (i + 1) for i, a in enumerate(k[:2]))
        du = dv = 0
        if kind == "OPENCV":
            du = 2 * k[2] * u * v + k[3] * (r2 + 2 * u * u)
            dv = 2 * k[3] * u * v + k[2] * (r2 + 2 * v * v)
        return fx * (u * radial + du) + cx, fy * (v * radial + dv) + cy

    def errors(self, image):
        result = {}
        for index, (x, y, point) in enumerate(self.points2D[image]):
            if point == "-1":
                continue
            xyz = [float(v) for v in self.points3D[point][:3]]
            pixel = self.project(image, xyz)
            result[index] = (math.hypot(pixel[0] - x, pixel[1] - y)
                             if pixel else math.inf)
        return result

    def centre(self, image):
        q, t = self.images[image][0][:4], self.images[image][0][4:]
        R = rotation(*q)
        return [-sum(R[r][c] * t[r] for r in range(3)) for c in range(3)]

    def radius(self):
        centres = [self.centre(image) for image in self.images]
        middle = [statistics.fmean(c) for c in zip(*centres)]
        return math.sqrt(statistics.fmean(
            math.dist(c, middle) ** 2 for c in centres))

    def shift(self, image, percent, rng):
        """In any direction of the world, so in any of the camera."""
        d = [rng.gauss(0, 1) for _ in range(3)]
        length = percent / 100 * self.radius() / math.hypot(*d)
        pose = self.images[image][0]
        pose[4:] = [t + length * v for t, v in zip(pose[4:], d)]

    def turn(self, image, degrees, rng):
        """About its centre."""
        pose = self.images[image][0]
        q, t = pose[:4], pose[4:]
        axis = [rng.gauss(0, 1) for _ in range(3)]
        norm = math.sqrt(sum(a * a for a in axis))
        half = math.radians(degrees) / 2
        d = [math.cos(half), *(math.sin(half) * a / norm for a in axis)]
        D = rotation(*d)
        self.images[image][0] = multiply(d, q) + [
            sum(D[r][c] * t[c] for c in range(3)) for r in range(3)]


def rotation(w, x, y, z):
    n = w * w + x * x + y * y + z * z
    return [[(w * w + x * x - y * y - z * z) / n, 2 * (x * y - w * z) / n,
             2 * (x * z + w * y) / n],
            [2 * (x * y + w * z) / n, (w * w - x * x + y * y - z * z) / n,
             2 * (y * z - w * x) / n],
            [2 * (x * z - w * y) / n, 2 * (y * z + w * x) / n,
             (w * w - x * x - y * y + z * z) / n]]


def multiply(a, b):
    w, x, y, z = a
    W, X, Y, Z = b
    return [w * W - x * X - y * Y - z * Z, w * X + x * W + y * Z - z * Y,
            w * Y - x * Z + y * W + z * X, w * Z + x * Y - y * X + z * W]


def see_nearest(model, image):
    """2D points see what is projected nearest, within the limit."""
    cells = {}
    shown = {row[2] for points in model.points2D.values() for row in points}
    for point in shown - {"-1"}:
        xyz = [float(v) for v in model.points3D[point][:3]]
        pixel = model.project(image, xyz)
        if pixel:
            cell = (int(pixel[0] // LIMIT), int(pixel[1] // LIMIT))
            cells.setdefault(cell, []).append((pixel, point))
    taken = set()
    for row in model.points2D[image]:
        a, b = int(row[0] // LIMIT), int(row[1] // LIMIT)
        near = [(math.hypot(p[0] - row[0], p[1] - row[1]), point)
                for i in (-1, 0, 1) for j in (-1, 0, 1)
                for p, point in cells.get((a + i, b + j), [])]
        row[2] = "-1"
        if near and min(near)[0] < LIMIT and min(near)[1] not in taken:
            row[2] = min(near)[1]
            taken.add(row[2])


def adjust_points_and_filter(folder):
    """Into folder / "filtered"."""
    source = folder / "planted"
    for n in range(2):
        moved, kept = folder / f"moved{n}", folder / f"kept{n}"
        moved.mkdir()
        kept.mkdir()
        run("colmap", "bundle_adjuster", "--input_path", source,
            "--output_path", moved,
            *(word for name in ("extrinsics", "focal_length", "extra_params")
              for word in (f"--BundleAdjustment.refine_{name}", 0)))
        run("colmap", "point_filtering", "--input_path", moved, "--output_path",
            kept, "--max_reproj_error", LIMIT, "--min_track_len", 2,
            "--min_tri_angle", 0)
        source = kept
    to_text(source, folder / "filtered")


def to_text(source, target):
    target.mkdir()
    run("colmap", "model_converter", "--input_path", source, "--output_path",
        target, "--output_type", "TXT")


class Base:
    """A model before anything is planted, and what is called wrong in it."""

    def __init__(self, krot, path, folder, seed):
        if path:
            to_text(path, folder / "base")
        else:
            run(krot, "model_synthesizer", "--output_path", folder / "made",
                "--Scene.num_frames", 30, "--Scene.num_points", 1500,
                "--Scene.track_length", 5, "--Scene.pixel_noise", 1,
                "--random_seed", seed)
            run(krot, "bundle_adjuster", "--input_path", folder / "made",
                "--output_path", folder / "base", "--output_type", "TXT")
        self.krot = krot
        self.model = Model(folder / "base")
        self.report = check(krot, folder / "base", folder)
        self.images = called_images(self.report, self.model)
        self.observations = called_observations(self.report, self.model)


def check(krot, path, folder):
    run(krot, "model_checker", "--input_path", path, "--report_path",
        folder / "report.json", "--num_threads", 1)
    return json.loads((folder / "report.json").read_text())


def called_images(report, model):
    errors = {image: list(model.errors(image).values())
              for image in model.images}
    means = {i: statistics.fmean(e) for i, e in errors.items() if e}
    middle = statistics.median(means.values())
    return {"krot": {str(i["image_id"]) for i in report["images"]
                     if i["verdict"] == "wrong"},
            "mean": {i for i, m in means.items() if m > 2 * middle},
            "2 px": {i for i, e in errors.items()
                     if e and sum(v > 2 for v in e) > len(e) / 2}}


def called_observations(report, model):
    return {"krot": {(str(o["image_id"]), o["point2D_idx"])
                     for o in report["observations"]},
            "2 px": {(image, index) for image in model.images
                     for index, error in model.errors(image).items()
                     if error > 2}}


class Counts:
    """Of one fault: planted, found, and called of what is not."""

    def __init__(self):
        self.planted = self.thin = self.thin_found = 0
        self.found = dict.fromkeys(("krot", "mean", "2 px"), 0)
        self.called = dict.fromkeys(self.found, 0)
        self.asked = set()

    def add(self, planted, called, before, thin=frozenset()):
        self.planted += len(planted - thin)
        self.thin += len(planted & thin)
        self.thin_found += len(planted & thin & called["krot"])
        self.asked |= set(called)
        for rival, those in called.items():
            found = planted & those - thin
            self.found[rival] += len(found)
            self.called[rival] += len(found) + len(
                those - planted - before[rival] - thin)

    def row(self):
        cells = [str(self.planted), f"{self.thin_found} of {self.thin}"]
        for rival, found in self.found.items():
            if rival not in self.asked:
                cells += ["–", "–"]
                continue
            cells += [f"{part / whole:.3f}" if whole else "–" for part, whole
                      in ((found, self.planted), (found, self.called[rival]))]
        return " | ".join(cells)


def wrong_images(base, folder, rng, change, how, counts):
    model = copy.deepcopy(base.model)
    images = sorted(model.images)
    planted = set(rng.sample(images, 3 if len(images) >= 10 else 1))
    for image in sorted(planted):
        change(model, image)
    if how == "nearest":
        for image in sorted(planted):
            see_nearest(model, image)
    model.write(folder / "planted")
    final = folder / "planted"
    if how == "adjusted":
        adjust_points_and_filter(folder)
        final = folder / "filtered"
    report = check(base.krot, final, folder)
    model = Model(final)
    thin = {i for i in images
            if i not in model.images or len(model.errors(i)) < FEWEST}
    counts.add(planted, called_images(report, model), base.images, thin)


def wrong_observations(base, folder, rng, plant, percent, counts):
    model = copy.deepcopy(base.model)
    everything = [(image, index) for image in sorted(model.images)
                  for index, row in enumerate(model.points2D[image])
                  if row[2] != "-1"]
    chosen = sorted(rng.sample(everything, max(
        1, round(percent / 100 * len(everything)))))
    planted = set()
    for image, index in chosen:
        planted |= {(image, n) for n in plant(model, image, index)}
    model.write(folder / "planted")
    run(base.krot, "bundle_adjuster", "--input_path", folder / "planted",
        "--output_path", folder / "adjusted", "--output_type", "TXT")
    report = check(base.krot, folder / "adjusted", folder)
    counts.add(planted, called_observations(report, Model(folder / "adjusted")),
               base.observations)


def move(model, image, index, pixels, rng):
    angle = 2 * math.pi * rng.random()
    model.points2D[image][index][0] += pixels * math.cos(angle)
    model.points2D[image][index][1] += pixels * math.sin(angle)
    return [index]


def exchange(model, image, index, is_near, rng):
    """Two 2D points of an image get each other's 3D points."""
    rows = model.points2D[image]
    others = [n for n, row in enumerate(rows)
              if row[2] not in ("-1", rows[index][2])]
    if not others:
        return []
    other = rng.choice(others)
    if is_near:
        other = min(others, key=lambda n: math.dist(rows[n][:2],
                                                    rows[index][:2]))
    rows[index][2], rows[other][2] = rows[other][2], rows[index][2]
    return [index, other]


def all_faults():
    """Names, and what plants one trial: (base, folder, rng, counts)."""
    for kind, sizes, unit in (("turn", TURNS, "°"), ("shift", SHIFTS, " %")):
        for how in ("adjusted", "nearest"):
            for size in sizes:
                yield (f"{kind}ed by {size}{unit}, {how}",
                       lambda base, folder, rng, counts, kind=kind, how=how,
                       size=size: wrong_images(
                           base, folder, rng, lambda model, image:
                           getattr(model, kind)(image, size, rng), how, counts))
    for percent, sigmas in MOVES:
        yield (f"{percent} % moved by {sigmas} sigma",
               lambda base, folder, rng, counts, percent=percent,
               sigmas=sigmas: wrong_observations(
                   base, folder, rng, lambda model, image, index: move(
                       model, image, index, sigmas * base.report["sigma_px"],
                       rng), percent, counts))
    for name, is_near in (("", False), (", near", True)):
        yield (f"1 % exchanged{name}",
               lambda base, folder, rng, counts, is_near=is_near:
               wrong_observations(
                   base, folder, rng, lambda model, image, index: exchange(
                       model, image, index, is_near, rng), 0.5, counts))


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    krot = pathlib.Path(sys.argv[1]).resolve()
    path = sys.argv[2] if len(sys.argv) > 2 and sys.argv[2] != "-" else None
    num_seeds = int(sys.argv[3]) if len(sys.argv) > 3 else 10
    word = sys.argv[4] if len(sys.argv) > 4 else ""
    faults = [(name, trial) for name, trial in all_faults() if word in name]
    counts = {name: Counts() for name, _ in faults}
    base = None
    for seed in range(1, num_seeds + 1):
        if base is None or path is None:
            with tempfile.TemporaryDirectory() as name:
                base = Base(krot, path, pathlib.Path(name), seed)
        for fault, trial in faults:
            with tempfile.TemporaryDirectory() as name:
                trial(base, pathlib.Path(name), random.Random(seed),
                      counts[fault])
        print(f"\n{path or 'scenes'}, {seed} seeds\n\n"
              "| fault | planted | and with few left, found | krot: recall | "
              "precision | mean: recall | precision | 2 px: recall | precision |\n"
              "|---|---|---|---|---|---|---|---|---|")
        for fault, row in counts.items():
            print(f"| {fault} | {row.row()} |", flush=True)


if __name__ == "__main__":
    main()
