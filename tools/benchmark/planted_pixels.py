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
    by_name = {image[2]: image[1] for image in model.images.values()}
    own = {row[0]: [float(v) for v in row[4:]] for row in model.rows("cameras.txt")}
    for one in maps:
        for camera in one["cameras"]:  # a ray's pixel by both intrinsics, undistorted
            n = num_focal(model.cameras[str(camera["camera_id"])][0])
            w, h = sizes[str(camera["camera_id"])]
            for x, y in ((0, 0), (w, 0), (0, h), (w, h)):
                true, now = own[str(camera["camera_id"])], camera["params"]
                for i, v in enumerate((x, y)):
                    ray = (v - true[n + i]) / true[min(i, n - 1)]
                    worst = max(worst, abs(ray * now[min(i, n - 1)] + now[n + i] - v))
        for name in [] if one["cameras"] or change is None else one["images"]:
            w, h = sizes[by_name[name]]
            for x, y in ((0, 0), (w, 0), (0, h), (w, h)):
                back = mended(change(x, y, w, h), one["image_from_camera"])
                worst = max(worst, abs(back[0] - x), abs(back[1] - y))
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
