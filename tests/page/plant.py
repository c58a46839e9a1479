"""Gross errors in a model in COLMAP's text format.

Usage: plant.py MODEL COUNT   (changes MODEL/images.txt)
"""

import math
import pathlib
import random
import sys


def plant_outliers(model, count):
    """Moves so many observations of different points by 20 to 45 pixels in any
    direction: {(image name, point2D_idx): by what}."""
    path = pathlib.Path(model) / "images.txt"
    lines = path.read_text().splitlines()
    rows = [n for n, line in enumerate(lines) if not line.startswith("#")]
    draw = random.Random(1)
    planted, points = {}, set()
    while len(planted) < count:
        header, row = rows[2 * draw.randrange(len(rows) // 2):][:2]
        words = lines[row].split()
        i = draw.randrange(len(words) // 3)
        length, angle = draw.uniform(20, 45), draw.uniform(0, 2 * math.pi)
        point = words[3 * i + 2]
        if point == "-1" or point in points:
            continue
        points.add(point)
        by = (length * math.cos(angle), length * math.sin(angle))
        for n in range(2):
            words[3 * i + n] = repr(float(words[3 * i + n]) + by[n])
        lines[row] = " ".join(words)
        planted[lines[header].split(maxsplit=9)[9], i] = by
    path.write_text("\n".join(lines) + "\n")
    return planted


if __name__ == "__main__":
    plant_outliers(sys.argv[1], int(sys.argv[2]))
