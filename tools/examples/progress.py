"""progress.py MODEL_FOLDER: tells how far a solve is, and gives it up after three
messages, as somebody might who presses a button.
"""

import sys

import pykrot


class Stopped(Exception):
    pass


num_messages = 0


def tell(stage, max_error, lower_bound):
    global num_messages
    num_messages += 1
    print(stage, "largest error", max_error, "px, none below", lower_bound)
    if num_messages == 3:
        raise Stopped  # what is raised here ends the solve


try:
    result = pykrot.solve(pykrot.Model.read(sys.argv[1]), progress=tell)
    print(f"done at {result.max_error:.4f} px")
except Stopped:
    print("ended early")
