#!/usr/bin/env python3
"""What pykrot costs beside the executable: python_overhead.py KROT PYTHONPATH

Solves a synthetic street of 100,000 observations five times each, in turns, both
on all threads: `krot solver`, as its report says without reading and writing, and
pykrot.solve; proves that both reach the same maximum, to the bit, and prints the
medians and their ratio.
"""

import json
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time


def solve_by_command(krot, model, folder):
    report = folder / "report.json"
    subprocess.run([krot, "solver", "--input_path", model, "--output_path",
                    folder / "out", "--overwrite", "1", "--report_path", report,
                    "--log_level", "0"], check=True, stdout=subprocess.DEVNULL)
    report = json.loads(report.read_text())
    return (sum(report["seconds"][stage] for stage in ("build", "solve", "certify")),
            report)


def main():
    krot, python_path = sys.argv[1:]
    sys.path.insert(0, python_path)
    import pykrot  # pylint: disable=import-outside-toplevel

    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        subprocess.run([krot, "model_synthesizer", "--output_path",
                        folder / "model", "--Scene.layout", "street",
                        "--Scene.num_frames", "200", "--Scene.num_points",
                        "20000", "--Scene.track_length", "5",
                        "--Scene.pixel_noise", "1",
                        "--Scene.start_translation_noise", "0.003",
                        "--Scene.start_point_noise", "0.003", "--log_level",
                        "0"], check=True, stdout=subprocess.DEVNULL)
        model = pykrot.Model.read(str(folder / "model"))
        by_command, by_python = [], []
        for _ in range(5):
            seconds, report = solve_by_command(krot, folder / "model", folder)
            by_command.append(seconds)
            begin = time.perf_counter()
            result = pykrot.solve(model)
            by_python.append(time.perf_counter() - begin)
            assert result.report["cost_final"] == report["cost_final"]
        count = report["num_observations"]
    command, python = map(statistics.median, (by_command, by_python))
    print(f"{count} observations: command {command:.3f} s, pykrot {python:.3f} s,"
          f" ratio {python / command:.3f}")


if __name__ == "__main__":
    main()
