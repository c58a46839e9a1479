#!/usr/bin/env python3
"""Camera centres from rotations and raw tracks, against the truth.

    raw_tracks.py KROT BENCHMARK [NAME=MODEL=TRUTH...]

By `krot solver --Solver.init feasible --Solver.max_error`, and by robust least
squares from random positions (`krot_benchmark positioning`); and both after
`krot bundle_adjuster` with a Cauchy loss. Of synthetic scenes of 40 images and
2000 points, with one pixel of noise, 1 to 20 % of the observations anywhere
and rotations off by up to one degree; and of every model named. RMS distances
after the similarity that fits best, in per cent of the cameras' distance from
their centroid; user CPU seconds.
"""

import json
import pathlib
import resource
import subprocess
import sys
import tempfile

SCENES = ([(ratio, 0.0) for ratio in (0.01, 0.05, 0.1, 0.2)]
          + [(0.05, degrees) for degrees in (0.1, 0.5, 1.0)])


def run(*arguments):
    """User CPU seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run([*map(str, arguments)], capture_output=True,
                          text=True, check=False)
    if done.returncode != 0:
        print(f"{' '.join(map(str, arguments))}: {done.stderr}",
              file=sys.stderr)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


class Ways:
    def __init__(self, krot, benchmark, folder):
        self.krot, self.benchmark, self.folder = krot, benchmark, folder

    def centres(self, truth, model):
        report = self.folder / "compared.json"
        report.unlink(missing_ok=True)
        run(self.krot, "model_comparer", "--input_path1", truth,
            "--input_path2", model, "--alignment", "similarity",
            "--report_path", report)
        if not report.exists():
            return float("nan")
        compared = json.loads(report.read_text())
        return 100 * compared["center"]["rms"] / compared["scene_radius"]

    def adjusted(self, model):
        output = self.folder / "adjusted"
        seconds = run(self.krot, "bundle_adjuster", "--input_path", model,
                      "--output_path", output, "--overwrite", 1,
                      "--BundleAdjustmentCeres.loss_function_type", "CAUCHY")
        return output, seconds

    def row(self, name, model, truth, max_error):
        output = self.folder / "krot"
        report = self.folder / "krot.json"
        seconds = run(self.krot, "solver", "--input_path", model,
                      "--output_path", output, "--overwrite", 1,
                      "--Solver.init", "feasible", "--Solver.max_error",
                      max_error, "--Solver.finish_loss", "cauchy",
                      "--report_path", report)
        removed = json.loads(report.read_text())["outliers"]["num_removed"]
        own = self.centres(truth, output)
        adjusted, more = self.adjusted(output)
        own_adjusted = self.centres(truth, adjusted)
        rival = self.folder / "rival"
        rival_seconds = run(self.benchmark, "positioning", "--input_path",
                            model, "--output_path", rival)
        rival_own = self.centres(truth, rival)
        adjusted, rival_more = self.adjusted(rival)
        rival_adjusted = self.centres(truth, adjusted)
        print(f"| {name} | {removed} | {own:.3f} | {own_adjusted:.3f} | "
              f"{seconds:.1f} + {more:.1f} | {rival_own:.3f} | "
              f"{rival_adjusted:.3f} | {rival_seconds:.1f} + "
              f"{rival_more:.1f} |", flush=True)


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    print("| model | left out | solver | adjusted | s | bearings | adjusted "
          "| s |\n|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        ways = Ways(sys.argv[1], sys.argv[2], folder)
        for ratio, degrees in SCENES:
            run(ways.krot, "model_synthesizer", "--output_path",
                folder / "scene", "--ground_truth_path", folder / "truth",
                "--overwrite", 1, "--Scene.num_frames", 40,
                "--Scene.num_points", 2000, "--Scene.track_length", 6,
                "--Scene.camera_model", "PINHOLE", "--Scene.pixel_noise", 1,
                "--Scene.outlier_ratio", ratio,
                "--Scene.rotation_noise_deg", degrees)
            ways.row(f"{100 * ratio:g} % outliers, {degrees:g} degrees",
                     folder / "scene", folder / "truth",
                     5 if degrees == 0 else 5 + 40 * degrees)
        for named in sys.argv[3:]:
            label, model, truth = named.split("=")
            ways.row(label, model, truth, 10)


if __name__ == "__main__":
    main()
