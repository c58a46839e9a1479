#!/usr/bin/python3
"""Turns a photogrammetric project into a COLMAP text model.

    photogrammetry_to_colmap.py dbat CAMERA.xml IMAGES EO POINTS OUT
    photogrammetry_to_colmap.py aicon NAME OUT

dbat: the text files of the Damped Bundle Adjustment Toolbox. IMAGES has lines
"id, path", EO "id, X, Y, Z, omega, phi, kappa" in degrees, POINTS "image id,
point id, x, y" in pixels. Its lens corrects what was measured (Brown, K and P
in mm), which no camera model of COLMAP does: what is written are the corrected
image points, under SIMPLE_PINHOLE.

aicon: NAME.phc, .ior, .eor and .obc of AICON 3D Studio. Its lens is OPENCV's,
but for the affinity and shear C1, C2, which are taken off the image points.

3D points whose positions are not given are intersected from their rays. The
ids of images and of 3D points are those of the project.
"""

import math
import re
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np


def rotation(omega, phi, kappa):
    """World from camera, x right, y up, seen from behind; radians."""
    def about(axis, angle):
        a, b = [(1, 2), (2, 0), (0, 1)][axis]
        matrix = np.eye(3)
        matrix[a, a] = matrix[b, b] = math.cos(angle)
        matrix[b, a] = math.sin(angle)
        matrix[a, b] = -math.sin(angle)
        return matrix
    return about(0, omega) @ about(1, phi) @ about(2, kappa)


def cam_from_world(angles):
    """COLMAP's: x right, y down, z forward."""
    return np.diag([1, -1, -1]) @ rotation(*angles).T


def quaternion(R):
    """qw qx qy qz, by the eigenvector that is stable for all rotations."""
    K = np.array([
        [np.trace(R), R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
        [0, R[0, 0] - R[1, 1] - R[2, 2], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
        [0, 0, R[1, 1] - R[0, 0] - R[2, 2], R[1, 2] + R[2, 1]],
        [0, 0, 0, R[2, 2] - R[0, 0] - R[1, 1]]])
    return np.linalg.eigh(K, UPLO="U")[1][:, 3]


def intersect(rays):
    """The point nearest to all rays (centre, direction)."""
    A, b = np.zeros((3, 3)), np.zeros(3)
    for centre, direction in rays:
        P = np.eye(3) - np.outer(direction, direction) / (direction @ direction)
        A += P
        b += P @ centre
    return np.linalg.solve(A, b)


def write(out, camera, images, observations, points):
    """images: id -> (name, centre, R); observations: (image, point, x, y)."""
    out = Path(out)
    out.mkdir(parents=True, exist_ok=True)
    model, width, height, params = camera
    by_image, by_point = defaultdict(list), defaultdict(list)
    for image, point, x, y in observations:
        by_point[point].append((image, len(by_image[image]), x, y))
        by_image[image].append((point, x, y))
    (out / "cameras.txt").write_text(
        f"1 {model} {width} {height} " + " ".join(map(repr, params)) + "\n")
    with open(out / "images.txt", "w") as file:
        for image, (name, centre, R) in sorted(images.items()):
            pose = [*quaternion(R), *(-R @ centre)]
            file.write(f"{image} {' '.join(repr(float(v)) for v in pose)} 1 "
                       f"{name}\n")
            file.write(" ".join(f"{x!r} {y!r} {point}"
                                for point, x, y in by_image[image]) + "\n")
    f, cx, cy = params[0], params[-2], params[-1]
    if model == "OPENCV":
        f, cx, cy = params[0], params[2], params[3]
    with open(out / "points3D.txt", "w") as file:
        for point, track in sorted(by_point.items()):
            if point not in points:
                points[point] = intersect(
                    [(images[i][1],
                      images[i][2].T @ [(x - cx) / f, (y - cy) / f, 1])
                     for i, _, x, y in track])
            xyz = " ".join(repr(float(v)) for v in points[point])
            file.write(f"{point} {xyz} 128 128 128 -1 "
                       + " ".join(f"{i} {n}" for i, n, _, _ in track) + "\n")


def rows(path):
    for line in Path(path).read_text().splitlines():
        if line.strip() and not line.startswith("#"):
            yield [cell.strip() for cell in line.split(",")]


def dbat(camera_path, images_path, eo_path, points_path, out):
    text = Path(camera_path).read_text()

    def values(tag):
        return re.search(f"<{tag}>(.*?)</{tag}>", text).group(1).split(",")

    width, height = map(int, values("image"))
    sensor_width, sensor_height = values("sensor")
    pixel = float(sensor_height) / height
    pixel_x = pixel if sensor_width == "auto" else float(sensor_width) / width
    cc = float(values("cc")[0])
    ppx, ppy = map(float, values("pp"))
    K = list(map(float, values("K")))
    P = list(map(float, values("P")))
    params = [cc / pixel, ppx / pixel, ppy / pixel]

    images = {}
    names = {int(row[0]): Path(row[1]).name for row in rows(images_path)}
    for row in rows(eo_path):
        centre = np.array(list(map(float, row[1:4])))
        images[int(row[0])] = (
            names[int(row[0])], centre,
            cam_from_world([math.radians(float(a)) for a in row[4:7]]))
    observations = []
    for row in rows(points_path):
        x = pixel_x / pixel * (pixel * float(row[2]) - ppx)
        y = ppy - pixel * float(row[3])  # upwards
        r2 = x * x + y * y
        radial = sum(k * r2 ** (n + 1) for n, k in enumerate(K))
        dx = x * radial + P[0] * (r2 + 2 * x * x) + 2 * P[1] * x * y
        dy = y * radial + P[1] * (r2 + 2 * y * y) + 2 * P[0] * x * y
        observations.append((int(row[0]), int(row[1]),
                             params[1] + (x + dx) / pixel,
                             params[2] - (y + dy) / pixel))
    write(out, ("SIMPLE_PINHOLE", width, height, params), images, observations,
          {})


def aicon(name, out):
    ior = " ".join(Path(name + ".ior").read_text().split()).split(" ")
    (ck, xh, yh, A1, A2, r0, A3, B1, B2, C1, C2, width_mm, _, width,
     height) = map(float, ior[2:17])
    if A3 != 0:
        sys.exit(f"{name}.ior: A3 is {A3}; OPENCV has two radial terms")
    pixel = width_mm / width
    images = {}
    for line in Path(name + ".eor").read_text().splitlines():
        cells = line.split()
        images[int(cells[0])] = (f"image{int(cells[0]):04}.jpg",
                                 np.array(list(map(float, cells[2:5]))),
                                 cam_from_world(map(float, cells[5:8])))
    points = {}
    for line in Path(name + ".obc").read_text().splitlines():
        cells = line.split()
        points[int(cells[0])] = np.array(list(map(float, cells[1:4])))
    # x + x (A1 (r^2 - r0^2) + A2 (r^4 - r0^4)) = s x + x (A1 r^2 + A2 r^4)
    c = abs(ck)
    s = 1 - A1 * r0 ** 2 - A2 * r0 ** 4
    f = c * s / pixel
    params = [f, f, width / 2 + xh / pixel, height / 2 - yh / pixel,
              A1 * c ** 2 / s, A2 * c ** 4 / s, -B2 * c / s, B1 * c / s]
    observations = []
    for line in Path(name + ".phc").read_text().splitlines():
        cells = line.split()
        image, point = int(cells[0]), int(cells[1])
        if cells[9] != "1" or image not in images or point not in points:
            continue  # not used, as the flag says
        x, y, _, _, vx, vy = map(float, cells[2:8])
        _, centre, R = images[image]
        ray = R @ (points[point] - centre)
        xs, ys = c * ray[0] / ray[2], -c * ray[1] / ray[2]  # upwards
        observations.append((image, point,
                             width / 2 + (x - C1 * xs - C2 * ys) / pixel,
                             height / 2 - y / pixel))
    write(out, ("OPENCV", int(width), int(height), params), images,
          observations, points)


if __name__ == "__main__":
    commands = {("dbat", 7): dbat, ("aicon", 4): aicon}
    command = commands.get((sys.argv[1] if sys.argv[1:] else "", len(sys.argv)))
    if not command:
        sys.exit(__doc__)
    try:
        command(*sys.argv[2:])
    except OSError as error:
        sys.exit(f"{error.filename}: cannot be read or written: "
                 f"{error.strerror}")
    except (AttributeError, IndexError, KeyError, ValueError) as error:
        sys.exit(f"found no {sys.argv[1]} project in {sys.argv[2:-1]}, expected "
                 f"the files that --help describes: {error!r}")
