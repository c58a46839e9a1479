#!/usr/bin/env python3
"""How few observations `krot outlier_filter` removes, and how many must go.

    outlier_bracket.py KROT DATA [NAME...]

For every model NAME of the folder DATA (all of them if none is named) and
bounds of 0.9, 0.75 and 0.5 times its optimum: what the conflicts' method
removes, what it proves, their ratio, what the threshold's method removes, and
the seconds of both. Every proof is judged by certificate_checker.
"""

import json
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

SHARES = (0.9, 0.75, 0.5)


def run(krot, *arguments):
    start = time.monotonic()
    done = subprocess.run([krot, *arguments, "--log_level", "0"],
                          capture_output=True, text=True, errors="replace",
                          check=False)
    return done, time.monotonic() - start


def filter_model(krot, model, folder, max_error, method):
    report = folder / f"{method}.json"
    arguments = ["outlier_filter", "--input_path", str(model),
                 "--output_path", str(folder / method), "--overwrite", "1",
                 "--OutlierFilter.max_error", repr(max_error),
                 "--OutlierFilter.method", method,
                 "--report_path", str(report)]
    if method == "conflicts":
        arguments += ["--conflicts_path", str(folder / "proof.json")]
    done, seconds = run(krot, *arguments)
    if done.returncode != 0:
        return None, seconds, done.stderr.strip()
    return json.loads(report.read_text()), seconds, ""


def optimum(krot, model, folder):
    report = folder / "optimum.json"
    done, _ = run(krot, "solver", "--input_path", str(model),
                  "--output_path", str(folder / "optimum"),
                  "--overwrite", "1", "--report_path", str(report))
    if done.returncode not in (0, 8):
        return None
    return json.loads(report.read_text())["cost_final"]


def measure(krot, model, folder):
    """Yields a row per bound."""
    cost = optimum(krot, model, folder)
    if not cost or cost < 1e-6:
        return
    for share in SHARES:
        few, seconds, error = filter_model(krot, model, folder, share * cost,
                                           "conflicts")
        if few is None:
            print(f"{model.name} {share}: {error}", flush=True)
            continue
        plain, plain_seconds, _ = filter_model(krot, model, folder,
                                               share * cost, "threshold")
        checked, _ = run(krot, "certificate_checker", "--input_path",
                         str(model), "--certificate_path",
                         str(folder / "proof.json"))
        yield {"model": model.name, "bound": share * cost,
               "observations": few["num_observations"],
               "removed": few["num_removed"], "must": few["num_must_go"],
               "threshold": plain["num_removed"] if plain else None,
               "seconds": seconds, "threshold_seconds": plain_seconds,
               "within": few["is_within"],
               "checked": checked.returncode == 0}


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    krot, data = sys.argv[1], pathlib.Path(sys.argv[2])
    names = sys.argv[3:] or sorted(p.name for p in data.iterdir()
                                   if p.is_dir())
    ratios = []
    print(f"{'model':20} {'bound':>8} {'of':>8} {'removed':>8} {'must':>6} "
          f"{'ratio':>6} {'threshold':>9} {'s':>7} {'thr. s':>7}  proof")
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            for row in measure(krot, data / name, pathlib.Path(folder)):
                ratio = row["removed"] / max(1, row["must"])
                ratios.append(ratio)
                state = "holds" if row["checked"] else "REFUSED"
                if not row["within"]:
                    state += ", NOT WITHIN"
                if (row["threshold"] is not None
                        and row["removed"] > row["threshold"]):
                    state += ", MORE THAN THE THRESHOLD"
                print(f"{row['model']:20} {row['bound']:8.4f} "
                      f"{row['observations']:8} {row['removed']:8} "
                      f"{row['must']:6} {ratio:6.2f} "
                      f"{row['threshold'] if row['threshold'] is not None else '-':>9} "
                      f"{row['seconds']:7.2f} {row['threshold_seconds']:7.2f}"
                      f"  {state}", flush=True)
    if ratios:
        print(f"median ratio {statistics.median(ratios):.2f}")


if __name__ == "__main__":
    main()
