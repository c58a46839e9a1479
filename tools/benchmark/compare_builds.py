#!/usr/bin/env python3
"""Compares two builds of krot, command by command, on every model of a folder.

Runs both builds in turn and compares what they report: largest error, proved
bound, RMS error, exit code, iterations, processor seconds, and whether
certificate_checker accepts the certificate. Prints one row for each model and
command that differs, then medians of after / before over all models.

Usage: compare_builds.py KROT_BEFORE KROT_AFTER MODELS [NAME...]
       [--commands solver,joint,...] [--runs N] [--timeout SECONDS] [--all]
"""
import argparse
import json
import pathlib
import resource
import statistics
import subprocess
import tempfile

# The arguments of each command beyond its input and output.
COMMANDS = {
    "solver": ["solver"],
    "joint": ["solver", "--Solver.method", "joint"],
    "sweeps": ["solver", "--Solver.method", "res_int",
               "--ResInt.max_sweeps", "5"],
    "feasible": ["solver", "--Solver.init", "feasible"],
    "triangulator": ["point_triangulator"],
    "adjuster": ["bundle_adjuster", "--BundleAdjustmentCeres.num_threads", "1"],
    "filter": ["outlier_filter", "--OutlierFilter.max_error", "2"],
    "analyzer": ["model_analyzer"],
}
RELATIVE_TOLERANCE = 1e-6


def run(krot, arguments, timeout):
    """The exit code and the processor seconds of one command."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        code = subprocess.run([krot, *arguments], capture_output=True,
                              timeout=timeout, check=False).returncode
    except subprocess.TimeoutExpired:
        code = "timeout"
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return code, (after.ru_utime - before.ru_utime
                  + after.ru_stime - before.ru_stime)


def measure(krot, command, model, folder, runs, timeout):
    """What one build reports of one command on one model."""
    report = folder / "report.json"
    certificate = folder / "certificate.json"
    for path in (report, certificate):
        path.unlink(missing_ok=True)
    arguments = list(COMMANDS[command])
    if arguments[0] == "model_analyzer":
        arguments += ["--path", str(model)]
    else:
        arguments += ["--input_path", str(model), "--overwrite", "1",
                      "--output_path", str(folder / "output")]
    if arguments[0] == "solver" and command != "sweeps":
        arguments += ["--certificate_path", str(certificate)]
    arguments += ["--report_path", str(report)]
    seconds = []
    for _ in range(runs):
        code, took = run(krot, arguments, timeout)
        seconds.append(took)
    result = {"code": code, "seconds": statistics.median(seconds)}
    if report.exists():
        told = json.loads(report.read_text())
        errors = told.get("pixel_error") or {}
        errors = errors.get("after", errors)
        result["max"] = errors.get("max")
        result["rms"] = errors.get("rms")
        result["bound"] = told.get("lower_bound")
        result["must_go"] = told.get("num_must_go")
        result["removed"] = told.get("num_removed")
        iterations = told.get("iterations")
        if isinstance(iterations, list):
            finish = (told.get("finish") or {}).get("num_iterations", 0)
            result["iterations"] = len(iterations) + finish
    if certificate.exists():
        verdict, _ = run(krot, ["certificate_checker", "--input_path",
                                str(folder / "output"), "--certificate_path",
                                str(certificate)], timeout)
        result["accepted"] = verdict == 0
    return result


def is_same(before, after):
    if isinstance(before, float) and isinstance(after, float):
        largest = max(abs(before), abs(after))
        return abs(before - after) <= RELATIVE_TOLERANCE * largest
    return before == after


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("models", type=pathlib.Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--commands", default=",".join(COMMANDS))
    parser.add_argument("--runs", type=int, default=1)
    parser.add_argument("--timeout", type=float, default=300)
    parser.add_argument("--all", action="store_true",
                        help="print the rows that are the same, too")
    arguments = parser.parse_args()
    names = arguments.names or sorted(
        path.name for path in arguments.models.iterdir() if path.is_dir())
    ratios = {}
    num_same = num_different = 0
    print("| model | command | quantity | before | after |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as work:
        folders = [pathlib.Path(work) / side for side in ("before", "after")]
        for folder in folders:
            folder.mkdir()
        for name in names:
            for command in arguments.commands.split(","):
                before, after = (
                    measure(krot, command, arguments.models / name, folder,
                            arguments.runs, arguments.timeout)
                    for krot, folder in zip((arguments.before, arguments.after),
                                            folders))
                for quantity in ("seconds", "iterations"):
                    if before.get(quantity) and after.get(quantity):
                        ratios.setdefault((command, quantity), []).append(
                            (after[quantity] / before[quantity], name))
                different = False
                for quantity in ("code", "max", "rms", "bound", "must_go",
                                 "removed", "accepted"):
                    values = [side.get(quantity) for side in (before, after)]
                    if not is_same(*values):
                        different = True
                    elif not arguments.all or values == [None, None]:
                        continue
                    print(f"| {name} | {command} | {quantity} | "
                          f"{values[0]} | {values[1]} |", flush=True)
                num_different += different
                num_same += not different
    print(f"\n{num_same} of {num_same + num_different} runs report the same, "
          f"to {RELATIVE_TOLERANCE:g} relative.\n")
    print("| command | quantity | median after / before | lowest | highest |")
    print("|---|---|---|---|---|")
    for (command, quantity), values in sorted(ratios.items()):
        low, high = min(values), max(values)
        median = statistics.median(value for value, _ in values)
        print(f"| {command} | {quantity} | {median:.3f} | "
              f"{low[0]:.3f} {low[1]} | {high[0]:.3f} {high[1]} |")


if __name__ == "__main__":
    main()
