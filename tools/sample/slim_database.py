#!/usr/bin/env python3
"""What of COLMAP's database says what verified matches there are, in a fifth of its size.

Usage: slim_database.py DATABASE SLIM

SLIM is a copy without descriptors and unverified matches. Of keypoints it has position, scale and
orientation, which COLMAP reads as well as the six numbers that it writes.
"""

import array
import math
import shutil
import sqlite3
import sys


def slim_keypoints(rows, data):
    full = array.array("f", data)
    slim = array.array("f")
    for row in range(rows):
        x, y, a11, a12, a21, a22 = full[6 * row:6 * row + 6]
        slim.extend([x, y, (math.hypot(a11, a21) + math.hypot(a12, a22)) / 2,
                     math.atan2(a21, a11)])
    return slim.tobytes()


def main(database, slim):
    shutil.copy(database, slim)
    connection = sqlite3.connect(slim)
    connection.execute("DELETE FROM descriptors")
    connection.execute("DELETE FROM matches")
    keypoints = connection.execute(
        "SELECT image_id, rows, data FROM keypoints WHERE cols = 6").fetchall()
    for image_id, rows, data in keypoints:
        connection.execute("UPDATE keypoints SET cols = 4, data = ? WHERE image_id = ?",
                           (slim_keypoints(rows, data), image_id))
    connection.commit()
    connection.execute("VACUUM")
    connection.close()


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
