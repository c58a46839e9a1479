#!/usr/bin/env python3
"""How few observations `krot outlier_filter` removes, and how many must go.

    outlier_bracket.py KROT DATA [NAME[=PIXELS]...]

For every model NAME of the folder DATA (all of them if none is named) and
bounds of 0.9, 0.75 and 0.5 times its optimum, or that of so many pixels: what
is removed, what is proved, their ratio, and the seconds of processor time.
Every proof is judged by certificate_checker. What takes more than twenty such
minutes, ten on two cores, is given up, and said so.
"""

import json
import pathlib
import resource
import signal
import statistics
import subprocess
import sys
import tempfile

SHARES = (0.9, 0.75, 0.5)
LIMIT_SECONDS = 1200


def processor_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run(krot, *arguments):
    """Return code, None if it took too long; its words; processor seconds."""
    before = processor_seconds()
    done = subprocess.run(
        [krot, *arguments, "--log_level", "0"], capture_output=True, text=True,
        errors="replace", check=False,
        preexec_fn=lambda: resource.setrlimit(
            resource.RLIMIT_CPU, (LIMIT_SECONDS, LIMIT_SECONDS)))
    code, words = done.returncode, done.stderr.strip()
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        code, words = None, f"more than {LIMIT_SECONDS} s"
    return code, words, processor_seconds() - before


def filter_model(krot, model, folder, max_error):
    report = folder / "report.json"
    code, words, seconds = run(
        krot, "outlier_filter", "--input_path", str(model),
        "--output_path", str(folder / "filtered"), "--overwrite", "1",
        "--OutlierFilter.max_error", repr(max_error),
        "--conflicts_path", str(folder / "proof.json"),
        "--report_path", str(report))
    if code != 0:
        return None, seconds, words
    return json.loads(report.read_text()), seconds, ""


def optimum(krot, model, folder):
    report = folder / "optimum.json"
    code, _, _ = run(krot, "solver", "--input_path", str(model),
                     "--output_path", str(folder / "optimum"),
                     "--overwrite", "1", "--report_path", str(report))
    if code not in (0, 8):
        return None
    return json.loads(report.read_text())["cost_final"]


def bounds_of(krot, model, pixels, folder):
    if pixels:
        return [float(pixels)]
    cost = optimum(krot, model, folder)
    if not cost or cost < 1e-6:
        return []
    return [share * cost for share in SHARES]


def measure(krot, model, pixels, folder):
    """Yields a row per bound."""
    for bound in bounds_of(krot, model, pixels, folder):
        few, seconds, error = filter_model(krot, model, folder, bound)
        if few is None:
            print(f"{model.name:20} {bound:8.4f} {error}", flush=True)
            continue
        code, _, _ = run(krot, "certificate_checker", "--input_path",
                         str(model), "--certificate_path",
                         str(folder / "proof.json"))
        yield {"model": model.name, "bound": bound,
               "observations": few["num_observations"],
               "removed": few["num_removed"], "must": few["num_must_go"],
               "seconds": seconds, "within": few["is_within"],
               "checked": code == 0}


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    krot, data = sys.argv[1], pathlib.Path(sys.argv[2])
    names = sys.argv[3:] or sorted(p.name for p in data.iterdir()
                                   if p.is_dir())
    ratios = []
    print(f"{'model':20} {'bound':>8} {'of':>8} {'removed':>8} {'must':>6} "
          f"{'ratio':>6} {'s':>7}  proof")
    for name in names:
        name, _, pixels = name.partition("=")
        with tempfile.TemporaryDirectory() as folder:
            for row in measure(krot, data / name, pixels,
                               pathlib.Path(folder)):
                ratio = row["removed"] / max(1, row["must"])
                ratios.append(ratio)
                state = "holds" if row["checked"] else "REFUSED"
                if not row["within"]:
                    state += ", NOT WITHIN"
                print(f"{row['model']:20} {row['bound']:8.4f} "
                      f"{row['observations']:8} {row['removed']:8} "
                      f"{row['must']:6} {ratio:6.2f} {row['seconds']:7.2f}"
                      f"  {state}", flush=True)
    if ratios:
        print(f"median ratio {statistics.median(ratios):.2f}")


if __name__ == "__main__":
    main()
