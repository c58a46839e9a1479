#!/usr/bin/env python3
"""How often `krot model_checker` calls something wrong in scenes that have nothing
but noise.

    false_alarms.py KROT [SCENES]

SCENES scenes (200) for each noise, of six kinds in turn, of 10 to 200 images and
mean track lengths from 2 to 20, drawn at random, after a bundle adjustment as
COLMAP would end with (panoramas have none and keep their true cameras).
Noise: Gaussian of one pixel; Student's t with five degrees of freedom; Gaussian
with a sigma for each image, from one to three pixels. An alarm is a scene with
anything wrong; `of an image` is the largest share of the observations of one
image that are.
"""

import json
import pathlib
import random
import subprocess
import sys
import tempfile

KINDS = {
    "orbit": {},
    "street": {"Scene.layout": "street"},
    "rigs of three": {"Scene.sensors_per_rig": 3},
    "fisheyes": {"Scene.camera_model": "OPENCV_FISHEYE",
                 "Scene.focal_length_factor": 0.5},
    "strong lenses": {"Scene.camera_model": "FULL_OPENCV",
                      "Scene.focal_length_factor": 0.5},
    "panoramas": {"Scene.camera_model": "EQUIRECTANGULAR"},
}
NOISES = ("Gaussian", "Student 5", "by image")
MAX_OBSERVATIONS = 20000


def run(krot, command, folder, *arguments):
    done = subprocess.run(
        [krot, command, *map(str, arguments), "--log_level", "0"],
        cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{command} {' '.join(map(str, arguments))}: {done.stderr}")


def add_noise(path, noise, rng):
    """To every 2D point of images.txt."""
    lines = path.read_text().splitlines()
    head = [line for line in lines if line.startswith("#")]
    body = [line for line in lines if not line.startswith("#")]
    for n in range(1, len(body), 2):
        row = body[n].split()
        image_sigma = 3 ** rng.random() if noise == "by image" else 1
        for i in range(0, len(row), 3):
            sigma = image_sigma
            if noise == "Student 5":
                sigma = (5 / rng.gammavariate(2.5, 2)) ** 0.5
            row[i] = repr(float(row[i]) + sigma * rng.gauss(0, 1))
            row[i + 1] = repr(float(row[i + 1]) + sigma * rng.gauss(0, 1))
        body[n] = " ".join(row)
    path.write_text("\n".join(head + body) + "\n")


def trial(krot, kind, noise, seed):
    """The report of model_checker."""
    rng = random.Random(seed)
    num_sensors = KINDS[kind].get("Scene.sensors_per_rig", 1)
    num_frames = max(4, round(10 * 20 ** rng.random() / num_sensors))
    num_images = num_frames * num_sensors
    track_length = min(2 * 10 ** rng.random(), num_images)
    num_points = min(20 * num_images + 500, MAX_OBSERVATIONS // track_length)
    options = {"Scene.num_frames": num_frames,
               "Scene.num_points": int(num_points),
               "Scene.track_length": track_length, "random_seed": seed,
               **KINDS[kind]}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        run(krot, "model_synthesizer", folder, "--output_path", "scene",
            "--output_type", "TXT",
            *(word for key, value in options.items()
              for word in (f"--{key}", value)))
        add_noise(folder / "scene" / "images.txt", noise, rng)
        model = "scene"
        if kind != "panoramas":
            model = "adjusted"
            run(krot, "bundle_adjuster", folder, "--input_path", "scene",
                "--output_path", model)
        run(krot, "model_checker", folder, "--input_path", model,
            "--report_path", "report.json")
        return json.loads((folder / "report.json").read_text())


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    krot = pathlib.Path(sys.argv[1]).resolve()
    num_scenes = int(sys.argv[2]) if len(sys.argv) > 2 else 200
    print("| noise | scene | scenes | with an alarm | wrong observations | of | "
          "of an image, at most | wrong images | weakly held | wrong cameras |\n"
          "|---|---|---|---|---|---|---|---|---|---|")
    for noise in NOISES:
        rows = {kind: [0, 0, 0, 0, 0.0, 0, 0, 0] for kind in [*KINDS, "all"]}
        for seed in range(1, num_scenes + 1):
            kind = list(KINDS)[seed % len(KINDS)]
            report = trial(krot, kind, noise, seed)
            share = max(image["num_wrong"] / max(1, image["num_tested"])
                        for image in report["images"])
            for row in rows[kind], rows["all"]:
                row[0] += 1
                row[1] += report["is_anything_wrong"]
                row[2] += report["num_wrong_observations"]
                row[3] += report["num_tested"]
                row[4] = max(row[4], share)
                row[5] += report["num_wrong_images"]
                row[6] += report["num_weakly_held_images"]
                row[7] += len(report["cameras"])
        for kind, row in rows.items():
            print(f"| {noise} | {kind} | {row[0]} | {row[1]} | {row[2]} | "
                  f"{row[3]} | {100 * row[4]:.1f} % | {row[5]} | {row[6]} | "
                  f"{row[7]} |",
                  flush=True)


if __name__ == "__main__":
    main()
