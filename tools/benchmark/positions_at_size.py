#!/usr/bin/env python3
"""Positions from nothing by the number of images, outliers and rotations.

    positions_at_size.py KROT BENCHMARK [orbit|street] [IMAGES ...]

KROT and BENCHMARK are the built programs. Makes rings (or streets) of so many
images (200, 1000 and 5000 if none are given; 400 observations each, tracks of
eight, noise of 1 px) with 0, 10 and 30 % of the observations wrong and
rotations off by 0, 0.3, 1 and 3 degrees (by 0.3 beyond 1000 images), and no
positions that fit, lets `krot solver --Solver.init feasible` find the positions
and `krot bundle_adjuster` adjust them with a Cauchy loss; up to 1000 images
also the rival of bearings (`krot_benchmark positioning`). Prints user and
system CPU seconds, memory, and the RMS distance of the centres from the truth
as a percentage of the radius. The Python standard library is enough.
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


def centres(krot, truth, model, report):
    """Of the radius, per cent; None without a model."""
    if os.path.exists(report):
        os.remove(report)
    run(krot, "model_comparer", "--input_path1", truth, "--input_path2", model,
        "--alignment", "similarity", "--report_path", report)
    if not os.path.exists(report):
        return None
    with open(report, encoding="utf-8") as file:
        comparison = json.load(file)
    return 100 * comparison["center"]["rms"] / comparison["scene_radius"]


def cell(value):
    return "" if value is None else f"{value:.3f}"


def measure(krot, benchmark, folder, images, share, turned, layout="orbit"):
    """One row of the table."""
    scene, truth, out, rival, adjusted, report, compared = (
        os.path.join(folder, name)
        for name in ("scene", "truth", "out", "rival", "adjusted",
                     "report.json", "compared.json"))
    code, _ = run(krot, "model_synthesizer", "--output_path", scene,
                  "--ground_truth_path", truth, "--Scene.layout", layout,
                  "--Scene.num_frames", str(images),
                  "--Scene.num_points", str(50 * images),
                  "--Scene.track_length", "8",
                  "--Scene.camera_model", "PINHOLE", "--Scene.pixel_noise", "1",
                  "--Scene.outlier_ratio", str(share),
                  "--Scene.rotation_noise_deg", str(turned),
                  "--Scene.start_translation_noise", "1")
    if code != 0:
        sys.exit(f"model_synthesizer ended with code {code}")

    def adjust(model):
        _, taken = run(krot, "bundle_adjuster", "--input_path", model,
                       "--output_path", adjusted, "--overwrite", "1",
                       "--BundleAdjustmentCeres.loss_function_type", "CAUCHY")
        return f"{cell(centres(krot, truth, adjusted, compared))} | {taken:.0f}"

    code, seconds = run(krot, "solver", "--input_path", scene,
                        "--output_path", out, "--report_path", report,
                        "--Solver.init", "feasible")
    if not os.path.exists(report):
        return (f"| {images} | {share:.0%} | {turned} | {seconds:.1f} | |"
                f" {code} | | | | | | | |")
    with open(report, encoding="utf-8") as file:
        memory = json.load(file)["peak_memory_bytes"]
    row = (f"| {images} | {share:.0%} | {turned} | {seconds:.1f} |"
           f" {memory / 2**20:.0f} | {code} |"
           f" {cell(centres(krot, truth, out, compared))} |"
           f" {adjust(out)} |")
    if images > 1000:
        return row + " | | | |"
    _, seconds = run(benchmark, "positioning", "--input_path", scene,
                     "--output_path", rival)
    return (row + f" {seconds:.1f} |"
            f" {cell(centres(krot, truth, rival, compared))} |"
            f" {adjust(rival)} |")


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    print("| images | wrong | degrees | processor s | MB | code | centres |"
          " adjusted | s | rival: s | centres | adjusted | s |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    layout, sizes = "orbit", sys.argv[3:]
    if sizes and not sizes[0].isdigit():
        layout, *sizes = sizes
    for images in [int(n) for n in sizes] or [200, 1000, 5000]:
        for share in (0, 0.1, 0.3):
            for turned in (0, 0.3, 1, 3) if images <= 1000 else (0.3,):
                with tempfile.TemporaryDirectory() as folder:
                    print(measure(*sys.argv[1:3], folder, images, share,
                                  turned, layout), flush=True)


if __name__ == "__main__":
    main()
