#!/usr/bin/env python3
"""Whether `krot model_checker` finds a camera that is wrong for all of its images.

    planted_cameras.py KROT MODEL [MODEL ...]

Each MODEL is one of pinholes, SIMPLE_RADIAL, RADIAL or OPENCV cameras without
rigs (read through `colmap model_converter`). The second half of its images, or
one of them, gets a camera of its own, first with the same values, and then with
a wrong one: the focal length is so many per cent too long, the principal point
off by 3 % of the width, or the first radial term has the other sign. Then come
rigs of three cameras, made by `krot model_synthesizer`, whose second camera is
turned or moved (by half of its baseline) in the rig. All is adjusted with the
cameras held (krot bundle_adjuster). Where each image has a camera of its own
already, the halves keep them, and there is nothing to tell.

Prints per fault the noise that model_checker finds without and with it, what it
blames: the camera, another one, images; and what it asks for.
"""

import copy
import json
import math
import pathlib
import sys
import tempfile

import planted_faults
from planted_faults import multiply, rotation, run, to_text

HELD = [word for name in ("focal_length", "extra_params", "sensor_from_rig")
        for word in (f"--BundleAdjustment.refine_{name}", 0)]
NEW = "9999"


def is_two(kind):
    return kind in ("PINHOLE", "OPENCV")


def longer(percent):
    def change(kind, width, p):
        for n in range(2 if is_two(kind) else 1):
            p[n] *= 1 + percent / 100
        return True
    return change


def shifted(kind, width, p):
    p[2 if is_two(kind) else 1] += 0.03 * width
    return True


def other_sign(kind, width, p):
    n = 4 if is_two(kind) else 3
    if n >= len(p):
        return False
    p[n] *= -1
    return True


def lens_faults():
    for percent in (3, 8, 15):
        yield f"half of the images: focal length + {percent} %", True, longer(percent)
    yield "half: principal point", True, shifted
    yield "half: radial term", True, other_sign
    yield "one image: focal length + 8 %", False, longer(8)


def check(krot, folder, report):
    run(krot, "bundle_adjuster", "--input_path", folder / "planted",
        "--output_path", folder / "held", *HELD)
    run(krot, "model_checker", "--input_path", folder / "held", "--report_path",
        folder / report)
    return json.loads((folder / report).read_text())


def row(name, fault, clean, report, wrong):
    blamed = [camera["camera_id"] for camera in report["cameras"]]
    reasons = [camera["reason"] for camera in report["cameras"]
               if camera["camera_id"] == wrong]
    print(f"| {name} | {fault} | {clean['sigma_px']:.3f}, "
          f"{report['sigma_px']:.3f} | {'yes' if wrong in blamed else 'no'} | "
          f"{len(set(blamed) - {wrong})} | {report['num_wrong_images']} | "
          f"{reasons[0] if reasons else '–'} |", flush=True)


def lenses(krot, path):
    with tempfile.TemporaryDirectory() as name:
        to_text(path, pathlib.Path(name) / "text")
        model = planted_faults.Model(pathlib.Path(name) / "text")
    cameras = model.camera_file.decode()
    clean = {}
    for fault, is_half, change in lens_faults():
        planted = copy.deepcopy(model)
        images = list(planted.images)
        middle = len(images) // 2
        chosen = images[middle:] if is_half else images[middle:middle + 1]
        old = planted.images[chosen[0]][1]
        chosen = [i for i in chosen if planted.images[i][1] == old]
        for image in chosen:
            planted.images[image][1] = NEW
        words = next(line.split() for line in cameras.splitlines()
                     if not line.startswith("#") and line.split()[:1] == [old])
        p = [float(word) for word in words[4:]]
        for is_changed in (False, True):
            if is_changed and not change(words[1], int(words[2]), p):
                continue
            if not is_changed and is_half in clean:
                continue
            planted.camera_file = (cameras + " ".join(
                [NEW, *words[1:4], *map(repr, p)]) + "\n").encode()
            with tempfile.TemporaryDirectory() as name:
                folder = pathlib.Path(name)
                planted.write(folder / "planted")
                report = check(krot, folder, "report.json")
            if is_changed:
                row(pathlib.Path(path).name, fault, clean[is_half], report,
                    int(NEW))
            else:
                clean[is_half] = report


def place(words, degrees, share):
    """Turned about its centre, which moves by a share of the baseline."""
    q, t = [float(w) for w in words[:4]], [float(w) for w in words[4:]]
    half = math.radians(degrees) / 2
    d = [math.cos(half)] + [math.sin(half) / math.sqrt(6) * a
                            for a in (1, 2, -1)]
    D = rotation(*d)
    t = [sum(D[r][c] * t[c] for c in range(3)) for r in range(3)]
    length = share * math.hypot(*t)
    t = [t[0], t[1] + length, t[2]]
    return [*multiply(d, q), *t]


def rigs(krot):
    for layout in ("orbit", "street"):
        clean = None
        for degrees, share in ((0, 0), (0.5, 0), (2, 0), (5, 0), (0, 0.5)):
            with tempfile.TemporaryDirectory() as name:
                folder = pathlib.Path(name)
                planted = folder / "planted"
                run(krot, "model_synthesizer", "--output_path", planted,
                    "--output_type", "TXT", "--Scene.layout", layout,
                    "--Scene.num_frames", 20, "--Scene.sensors_per_rig", 3,
                    "--Scene.num_points", 1500, "--Scene.pixel_noise", 1)
                file = planted / "rigs.txt"
                *head, last = file.read_text().strip().split("\n")
                words = last.split()
                words[7:14] = map(repr, place(words[7:14], degrees, share))
                file.write_text("\n".join([*head, " ".join(words)]) + "\n")
                report = check(krot, folder, "report.json")
            if clean is None:
                clean = report
                continue
            row(f"rigs, {layout}", f"turned by {degrees}°" if degrees
                else "moved by half of its baseline", clean, report, 2)


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    krot = pathlib.Path(sys.argv[1]).resolve()
    print("| model | fault | noise without and with it, px | camera blamed | "
          "other cameras | images | what it asks for |\n"
          "|---|---|---|---|---|---|---|")
    for path in sys.argv[2:]:
        lenses(krot, path)
    rigs(krot)


if __name__ == "__main__":
    main()
