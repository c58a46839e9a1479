#!/usr/bin/python3
"""Checks a certificate without KROT, from the model's files and numpy alone.

Usage: check_certificate.py CERTIFICATE MODEL

It is the proof of docs/formats.md ("Certificate") in few lines, for p = 2, a
connected support, and a text model without rigs whose cameras are
SIMPLE_RADIAL. It samples condition (3) on a circle, where krot
certificate_checker proves it by interval arithmetic, and does not compare the
digest. Ends with an AssertionError if the certificate does not hold.
"""

import json
import sys

import numpy as np


def lines(name):
    with open(f"{sys.argv[2]}/{name}.txt", encoding="utf-8") as file:
        return [line.split() for line in file if line[0] != "#"]


def rotation(q):
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def project(camera, u, v):
    f, cx, cy, k = camera
    r = 1 + k * (u * u + v * v)
    return np.array([f * r * u + cx, f * r * v + cy])


if len(sys.argv) != 3:
    sys.exit(__doc__)
with open(sys.argv[1], encoding="utf-8") as file:
    certificate = json.load(file)
delta, gamma = certificate["rows_bound"], certificate["lower_bound"]
support = certificate["observations"]
cameras = {c[0]: np.array(c[4:], float) for c in lines("cameras")}
images = lines("images")
heads = {image[0]: image for image in images[::2]}
points2D = {image[0]: pixels for image, pixels in zip(images[::2], images[1::2])}

# The columns of M are the multipliers of one observation each, its rows the
# images and points of the support; g is what (1) is missed by.
rows = (sorted({o["image_id"] for o in support}),
        sorted({o["point3D_id"] for o in support}))
M = np.zeros((3 * sum(map(len, rows)), 3 * len(support)))
g, h = 0, 1e-30
angles = np.linspace(0, 2 * np.pi, 10000)
circle = np.array([np.cos(angles), np.sin(angles)])
for i, o in enumerate(support):
    image = heads[str(o["image_id"])]
    camera, R = cameras[image[8]], rotation(np.array(image[1:5], float))
    pixel = np.array(points2D[image[0]][3 * o["point2D_idx"]:][:2], float)
    u, y = np.array(o["bearing"][:2]) / o["bearing"][2], np.array(o["y"])
    top = delta * o["lambda"]
    assert np.linalg.norm(y) <= o["lambda"] * (1 + 1e-12), "y is too long"
    # The row at the bearing: (w; v) = E x_cam.
    J = np.c_[project(camera, u[0] + 1j * h, u[1]).imag,
              project(camera, u[0], u[1] + 1j * h).imag] / h
    e = project(camera, *u) - pixel
    E = np.r_[[[0, 0, 1]], np.c_[J, e - J @ u]]
    B = np.zeros((len(M), 3))
    B[3 * rows[0].index(o["image_id"]):][:3] = E.T
    B[3 * (len(rows[0]) + rows[1].index(o["point3D_id"])):][:3] = R.T @ E.T
    M[:, 3 * i:3 * i + 3] = B * [top, o["lambda"], o["lambda"]]
    g = g + B @ [top, *y]
    # (3), on the circle of gamma pixels around the pixel, as rays.
    rays = u[:, None] + np.linalg.solve(J, gamma * circle - e[:, None])
    for _ in range(20):
        f = project(camera, *rays) - pixel[:, None]
        rays = rays - np.linalg.solve(J, f - gamma * circle)
    assert np.abs(np.hypot(*f) - gamma).max() < 1e-9 * gamma, "no convergence"
    assert (-y @ (J @ (rays - u[:, None]) + e[:, None])).max() <= top * (1 + 1e-9)
# One frame's rows are left out: they follow, as a translation moves nothing.
error = np.linalg.norm(g[3:]) / np.linalg.svd(M[3:])[1][-1]
assert error < 0.25, "(1) is missed by too much"
print("no estimate has all errors below", gamma, "less a share of", 2 * error)
