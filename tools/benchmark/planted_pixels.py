#!/usr/bin/env python3
"""How well krot model_checker mends 2D points and cameras that are those of other photos.

Usage: planted_pixels.py KROT MODEL...

In every other image of each MODEL, without rigs, the 2D points become those of another photo; or
all cameras get other intrinsics. Prints for each fault of each model how many of the images were
named that have it and that have it not, and how far, at most, the corners of a photo are put from
where they were, in pixels of the model. Needs colmap.
"""

import copy
import json
import pathlib
import sys
import tempfile

from planted_faults import Model, run, to_text

# (x, y) of a photo of that size.
PIXELS = {
    "half the size": lambda x, y, w, h: (x / 2, y / 2),
    "turned by 90 degrees": lambda x, y, w, h: (y, w - x),
    "mirrored": lambda x, y, w, h: (w - x, y),
    "cropped": lambda x, y, w, h: (1.1 * x - 0.05 * w, 1.1 * y - 0.05 * h),
    "moved": lambda x, y, w, h: (x + 50, y - 20),
    "normalised": lambda x, y, w, h: (x / w, y / h),
    "from the middle": lambda x, y, w, h: (x - w / 2, y - h / 2),
}
# f (or fx, fy), cx, cy of a photo of that size; there is one focal length or two.
CAMERAS = {
    "principal point": lambda f, cx, cy, w, h: (f, cx + 0.02 * w, cy),
    "principal point, exchanged": lambda f, cx, cy, w, h: (f, cy, cx),
    "focal length": lambda f, cx, cy, w, h: ([1.05 * v for v in f], cx, cy),
}


def num_focal(model):
    return 1 if model.startswith("SIMPLE") or model == "RADIAL" else 2


def spoiled_cameras(model, change):
    lines = []
    for row in model.rows("cameras.txt"):
        params = [float(v) for v in row[4:]]
        n = num_focal(row[1])
        f, cx, cy = change(params[:n], *params[n:n + 2], *map(float, row[2:4]))
        lines.append(" ".join([*row[:4], *map(repr, [*f, cx, cy, *params[n + 2:]])]))
    return "\n".join(lines).encode() + b"\n"


def mended(corner, rows):
    """Where the map's inverse takes it."""
    (a, b, x), (c, d, y) = rows
    u, v = corner[0] - x, corner[1] - y
    return [(d * u - b * v) / (a * d - b * c), (a * v - c * u) / (a * d - b * c)]


def off(model, maps, change, sizes):
    worst = 0
    cameras = {row[0]: [float(v) for v in row[4:]] for row in model.rows("cameras.txt")}
    camera_of = {image[2]: image[1] for image in model.images.values()}

    def compare(camera, found, true):
        nonlocal worst
        w, h = sizes[camera]
        for x, y in ((0, 0), (w, 0), (0, h), (w, h)):
            pairs = zip(found(x, y), true(x, y, w, h))
            worst = max(worst, *(abs(a - b) for a, b in pairs))

    for one in maps:
        for camera in map(str, (row["camera_id"] for row in one["cameras"])):
            was = cameras[camera]
            now = next(row["params"] for row in one["cameras"] if str(row["camera_id"]) == camera)
            n = num_focal(model.cameras[camera][0])

            def seen(*pixel):  # the pixel of the same ray, undistorted
                return [(v - was[n + i]) / was[min(i, n - 1)] * now[min(i, n - 1)] + now[n + i]
                        for i, v in enumerate(pixel)]

            compare(camera, seen, change or (lambda x, y, w, h: (x, y)))
        for camera in set() if one["cameras"] else {camera_of[name] for name in one["images"]}:
            compare(camera, lambda x, y: mended(change(x, y, *sizes[camera]),
                                                one["image_from_camera"]),
                    lambda x, y, w, h: (x, y))
    return worst


def check(krot, planted, folder):
    run("rm", "-rf", folder / "planted")
    planted.write(folder / "planted")
    run(krot, "model_checker", "--input_path", folder / "planted", "--report_path",
        folder / "report.json")
    conventions = json.loads((folder / "report.json").read_text())["conventions"]
    return conventions["pixel_maps"] if conventions else []


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    krot = pathlib.Path(sys.argv[1])
    print("| model | fault | images with it | named | others named | corners off, px |")
    print("|---|---|---:|---:|---:|---:|")
    for path in map(pathlib.Path, sys.argv[2:]):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            to_text(path, folder / "base")
            model = Model(folder / "base")
            sizes = {row[0]: [float(v) for v in row[2:4]] for row in model.rows("cameras.txt")}
            for fault, change in {**PIXELS, **CAMERAS}.items():
                planted = copy.deepcopy(model)
                spoiled = {image[2] for image in model.images.values()}
                if fault in CAMERAS:
                    planted.camera_file = spoiled_cameras(model, change)
                else:
                    spoiled = set(sorted(spoiled)[::2])
                    for image, points in planted.points2D.items():
                        if planted.images[image][2] not in spoiled:
                            continue
                        w, h = sizes[planted.images[image][1]]
                        for point in points:
                            point[:2] = change(*point[:2], w, h)
                maps = check(krot, planted, folder)
                named = {name for one in maps for name in one["images"]}
                print(f"| {path.name} | {fault} | {len(spoiled)} | {len(named & spoiled)} | "
                      f"{len(named - spoiled)} | "
                      f"{off(model, maps, PIXELS.get(fault), sizes):.2f} |", flush=True)


if __name__ == "__main__":
    main()
