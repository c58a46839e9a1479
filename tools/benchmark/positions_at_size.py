#!/usr/bin/env python3
"""Positions from nothing by the number of images and the share of outliers.

    positions_at_size.py KROT [IMAGES ...]

KROT is the built program. Makes rings of so many images (200, 1000 and 5000
if none are given; 400 observations each, tracks of eight, noise of 1 px,
rotations off by 0.3 degrees) with 0, 10 and 30 % of the observations wrong,
lets `krot solver --Solver.init feasible --Solver.max_error 15` find the
positions, and prints what that took and how far the camera centres are from
the truth. The Python standard library is enough.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile


def run(*command):
    """The exit code and the processor seconds of a command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    code = subprocess.run(command, stdout=subprocess.DEVNULL,
                          stderr=subprocess.DEVNULL).returncode
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return code, (after.ru_utime + after.ru_stime -
                  before.ru_utime - before.ru_stime)


def measure(krot, folder, images, share):
    """One row of the table."""
    scene, truth, out, report, compared = (
        os.path.join(folder, name)
        for name in ("scene", "truth", "out", "report.json", "compared.json"))
    code, _ = run(krot, "model_synthesizer", "--output_path", scene,
                  "--ground_truth_path", truth, "--Scene.layout", "orbit",
                  "--Scene.num_frames", str(images),
                  "--Scene.num_points", str(50 * images),
                  "--Scene.track_length", "8",
                  "--Scene.camera_model", "PINHOLE", "--Scene.pixel_noise", "1",
                  "--Scene.outlier_ratio", str(share),
                  "--Scene.rotation_noise_deg", "0.3")
    if code != 0:
        sys.exit(f"model_synthesizer ended with code {code}")
    code, seconds = run(krot, "solver", "--input_path", scene,
                        "--output_path", out, "--report_path", report,
                        "--Solver.init", "feasible", "--Solver.max_error", "15")
    if not os.path.exists(report):
        return f"| {images} | {share:.0%} | {seconds:.1f} | | | | {code} |"
    run(krot, "model_comparer", "--input_path1", truth, "--input_path2", out,
        "--alignment", "similarity", "--report_path", compared)
    with open(report, encoding="utf-8") as file:
        memory = json.load(file)["peak_memory_bytes"]
    with open(compared, encoding="utf-8") as file:
        comparison = json.load(file)
    error = comparison["center"]
    radius = comparison["scene_radius"]
    return (f"| {images} | {share:.0%} | {seconds:.1f} | {memory / 2**20:.0f} |"
            f" {100 * error['median'] / radius:.2f} |"
            f" {100 * error['max'] / radius:.2f} | {code} |")


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    print("| images | wrong | processor s | MB | median centre, % of the radius"
          " | largest | code |")
    print("|---|---|---|---|---|---|---|")
    for images in [int(n) for n in sys.argv[2:]] or [200, 1000, 5000]:
        for share in (0, 0.1, 0.3):
            with tempfile.TemporaryDirectory() as folder:
                print(measure(sys.argv[1], folder, images, share), flush=True)


if __name__ == "__main__":
    main()
