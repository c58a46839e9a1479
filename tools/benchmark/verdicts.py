#!/usr/bin/env python3
"""What `krot model_checker` says of models, what that takes, and what it cures.

    verdicts.py KROT FOLDER
    verdicts.py KROT NAME=MODEL=TRUTH ...

The first one asks about every COLMAP model that is a folder in FOLDER: the first
sentence of the verdict, and processor seconds (user, one thread) beside those of
`krot solver`; the median of their ratio in the end.

The second one adjusts MODEL, and what `model_checker --output_path` makes of it
(`krot bundle_adjuster`), with least squares and with the Cauchy loss that
model_checker prints, and compares the centres with those of TRUTH, a model of
the true cameras (tools/sample/truth_to_colmap.sh, tools/scripts/
strecha_to_colmap.sh), after the similarity that fits best: mean distance, in
thousandths of the scene's unit.
"""

import json
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile


def run(*command, may_fail=False):
    """What it prints, and its seconds; the last line of its errors if it fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run([str(word) for word in command], capture_output=True,
                          text=True, errors="replace", check=False)
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    if done.returncode == 0:
        return done.stdout, seconds
    reason = (done.stderr.strip().splitlines() or ["no reason"])[-1]
    if not may_fail:
        sys.exit(f"{' '.join(map(str, command))}: {reason}")
    return None, reason


def print_verdicts(krot, path):
    print("| model | images | observations | verdict | checker, s | solver, s | "
          "ratio |\n|---|---|---|---|---|---|---|")
    ratios = []
    for model in sorted(p for p in path.iterdir() if p.is_dir()):
        if not any((model / f"images.{kind}").exists()
                   for kind in ("bin", "txt")):
            continue
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            out, checker = run(krot, "model_checker", "--input_path", model,
                               "--report_path", folder / "report.json",
                               "--num_threads", 1, may_fail=True)
            if out is None:
                print(f"| {model.name} | | | {checker} | | | |", flush=True)
                continue
            solved, solver = run(krot, "solver", "--input_path", model,
                                 "--output_path", folder / "solved",
                                 "--Solver.num_threads", 1, may_fail=True)
            report = json.loads((folder / "report.json").read_text())
        times = f"{checker:.2f} | – | –"
        if solved is not None:
            ratios.append(checker / solver)
            times = f"{checker:.2f} | {solver:.2f} | {ratios[-1]:.2f}"
        print(f"| {model.name} | {report['num_images']} | "
              f"{report['num_observations']} | {out.splitlines()[0]} | {times} |",
              flush=True)
    print(f"\nMedian of {len(ratios)} ratios: {statistics.median(ratios):.2f}")


def millimetres(krot, model, truth, folder, *loss):
    run(krot, "bundle_adjuster", "--input_path", model, "--output_path",
        folder / "adjusted", "--overwrite", 1, *loss)
    run(krot, "model_comparer", "--input_path1", truth, "--input_path2",
        folder / "adjusted", "--alignment", "similarity", "--report_path",
        folder / "compared.json")
    report = json.loads((folder / "compared.json").read_text())
    return f"{1000 * report['center']['mean']:.2f}"


def print_cures(krot, arguments):
    print("| model | least squares | Cauchy | cured | cured, Cauchy |\n"
          "|---|---|---|---|---|")
    for argument in arguments:
        name, model, truth = argument.split("=")
        with tempfile.TemporaryDirectory() as temporary:
            folder = pathlib.Path(temporary)
            run(krot, "model_checker", "--input_path", model, "--output_path",
                folder / "cured", "--report_path", folder / "report.json")
            report = json.loads((folder / "report.json").read_text())
            loss = ("--BundleAdjustmentCeres.loss_function_type", "CAUCHY",
                    "--BundleAdjustmentCeres.loss_function_scale",
                    report["cauchy_scale_px"])
            cells = [name] + [
                millimetres(krot, one, truth, folder, *words)
                for one in (model, folder / "cured") for words in ((), loss)]
            print(f"| {' | '.join(cells)} |", flush=True)


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    krot = pathlib.Path(sys.argv[1]).resolve()
    if "=" in sys.argv[2]:
        print_cures(krot, sys.argv[2:])
    else:
        print_verdicts(krot, pathlib.Path(sys.argv[2]))


if __name__ == "__main__":
    main()
