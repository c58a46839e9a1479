#!/usr/bin/env python3
"""Camera centres from rotations and verified matches alone, beside COLMAP's mapper.

Usage: from_matches.py KROT NAME=MODEL=DATABASE=TRUTH...

For each, `krot solver --Solver.init feasible --database_path` with the rotations of MODEL, which
COLMAP made, and with those of TRUTH, a model of the same images; and `colmap mapper` on the same
database, without the photos. Prints the distances of the centres from the truth after the
similarity that fits best, in TRUTH's unit and, the mean, in per cent of the cameras' radius, and
seconds of processor time. Needs colmap.
"""

import json
import os
import pathlib
import resource
import shutil
import subprocess
import sys
import tempfile


def run(*arguments):
    """Seconds of processor time."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([*map(str, arguments)], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL, env=dict(os.environ, QT_QPA_PLATFORM="offscreen"))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def write_rotations(truth, text, path):
    text.mkdir()
    run("colmap", "model_converter", "--input_path", truth, "--output_path", text,
        "--output_type", "TXT")
    rows = [line.split(maxsplit=9) for line in (text / "images.txt").read_text().splitlines()
            if not line.startswith("#")][::2]
    path.write_text("".join(f"{row[9]} {' '.join(row[1:5])}\n" for row in rows))


def row(krot, name, how, model, truth, seconds, folder):
    report = folder / "compared.json"
    run(krot, "model_comparer", "--input_path1", truth, "--input_path2", model, "--alignment",
        "similarity", "--report_path", report)
    compared = json.loads(report.read_text())
    center = compared["center"]
    radius = 100 / compared["scene_radius"]
    print(f"| {name} | {how} | {center['count']} | {center['mean']:.6f} | {center['rms']:.6f} | "
          f"{radius * center['mean']:.4f} | {seconds:.2f} |", flush=True)


def main(krot, *named):
    print("| scene | by | images | centres, mean | RMS | % of the radius | s |\n"
          "|---|---|---|---|---|---|---|")
    for entry in named:
        name, model, database, truth = entry.split("=")
        with tempfile.TemporaryDirectory() as temporary:
            folder = pathlib.Path(temporary)
            rotations = folder / "rotations.txt"
            write_rotations(truth, folder / "text", rotations)
            for how, given in (("krot, the mapper's rotations", []),
                               ("krot, true rotations", ["--rotations_path", rotations])):
                seconds = run(krot, "solver", "--input_path", model, "--database_path", database,
                              "--Solver.init", "feasible", "--output_path", folder / "krot",
                              "--overwrite", 1, *given)
                row(krot, name, how, folder / "krot", truth, seconds, folder)
            shutil.copy(database, folder / "database.db")
            (folder / "images").mkdir()
            (folder / "sparse").mkdir()
            seconds = run("colmap", "mapper", "--random_seed", 0, "--database_path",
                          folder / "database.db", "--image_path", folder / "images",
                          "--output_path", folder / "sparse")
            row(krot, name, "colmap mapper", folder / "sparse" / "0", truth, seconds, folder)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
