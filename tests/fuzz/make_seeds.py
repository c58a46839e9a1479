"""What the fuzzers begin with: models, certificates and lists that are valid.

Usage: make_seeds.py KROT FOLDER   (FOLDER/TARGET/... for each *_fuzz.cc)
"""

import pathlib
import random
import re
import sqlite3
import struct
import subprocess
import sys
import tempfile

PARTS = ("cameras", "rigs", "frames", "images", "points3D")
# As FuzzScene in fuzz.h.
SCENE = ["--Scene.num_frames", "5", "--Scene.num_points", "16",
         "--Scene.track_length", "4", "--Scene.sensors_per_rig", "2",
         "--Scene.pixel_noise", "0.5", "--Scene.start_translation_noise",
         "0.003", "--Scene.start_point_noise", "0.003", "--random_seed", "3"]


class Seeds:
    def __init__(self, krot, folder, scratch):
        self.krot = krot
        self.folder = folder
        self.scratch = scratch
        self.count = 0

    def add(self, target, data):
        self.count += 1
        (self.folder / target).mkdir(parents=True, exist_ok=True)
        (self.folder / target / f"seed{self.count}").write_bytes(data)

    def run(self, *words):
        return subprocess.run([self.krot, *map(str, words)], check=True,
                              capture_output=True, text=True).stdout

    def models(self):
        """Files one by one, and as a whole."""
        kinds = {"rigs": [], "legacy": ["--Scene.sensors_per_rig", "1",
                                        "--Scene.has_rigs", "0"],
                 "fisheye": ["--Scene.camera_model", "OPENCV_FISHEYE"]}
        for name, words in kinds.items():
            scene = [word for word in SCENE]
            for option, value in zip(words[::2], words[1::2]):
                if option in scene:
                    scene[scene.index(option) + 1] = value
                else:
                    scene += [option, value]
            for suffix, target in ("bin", "binary"), ("txt", "text"):
                model = self.scratch / f"{name}_{suffix}"
                self.run("model_synthesizer", "--output_path", model,
                         "--output_type", suffix.upper(), *scene)
                whole = b""
                for n, part in enumerate(PARTS):
                    file = model / f"{part}.{suffix}"
                    data = file.read_bytes() if file.exists() else b""
                    if data:
                        self.add(target, bytes([n]) + data)
                    elif suffix == "bin":
                        data = bytes(8)  # of no records
                    whole += struct.pack("<H", len(data)) + data
                if suffix == "bin":
                    self.add("model", whole)

    def proofs(self):
        model = self.scratch / "rigs_bin"
        for norm in ("1", "2", "inf"):
            file = self.scratch / "proof.json"
            self.run("solver", "--input_path", model, "--output_path",
                     self.scratch / "solved", "--overwrite", 1,
                     "--Solver.norm", norm, "--certificate_path", file)
            self.add("certificate", file.read_bytes())
        conflicts = self.scratch / "conflicts.json"
        self.run("outlier_filter", "--input_path", model, "--output_path",
                 self.scratch / "filtered", "--OutlierFilter.max_error", 0.5,
                 "--conflicts_path", conflicts)
        self.add("certificate", conflicts.read_bytes())
        dice = random.Random(1)
        for _ in range(8):
            self.add("certificate", b"T" + dice.randbytes(30))

    def lists(self):
        lines = [line.split() for line in
                 (self.scratch / "rigs_txt" / "images.txt").read_text()
                 .splitlines() if not line.startswith("#")][::2]
        rotations = "".join(f"{' '.join(words[9:])} {' '.join(words[1:5])}\n"
                            for words in lines)
        self.add("lists", b"\0" + rotations.encode())
        self.add("lists", b"\1" + "\n".join(words[0] for words in lines)
                 .encode())
        self.add("lists", b"\2# points\n1\n2\n16\n")
        positions = "".join(
            f"{' '.join(words[9:])} {' '.join(words[5:8])} 1e-2\n"
            for words in lines)
        self.add("lists", b"\3" + positions.encode())
        self.add("lists", b"\4# points\n1 0 0 0 1\n2 0 0 0 1 2 3\n"
                 b"16 0 0 0 1 2 3 1 0 0 .5\n")

    def options(self):
        table = re.findall(r"^  --(\S+)$.*?Default: (\S*?)\.?$",
                           self.run("solver", "-h"), re.M | re.S)
        lines = [f"--{name}={value}" for name, value in table]
        for n in range(0, len(lines), 5):
            self.add("options", b"\0" + "\n".join(lines[n:n + 5]).encode())
        self.add("options", b"\1--input_path=a\f[Solver]\nnorm=inf\n"
                            b"init = feasible\n# a comment\n")

    def databases(self):
        """In pages of 512 bytes, as inputs are short."""
        file = self.scratch / "database.db"
        self.run("model_synthesizer", "--output_path", self.scratch / "matched",
                 "--database_path", file, *SCENE)
        database = sqlite3.connect(file)
        database.executescript("PRAGMA page_size = 512; VACUUM")
        self.add("database", file.read_bytes())
        database.executescript("DROP TABLE matches; DROP TABLE descriptors; "
                               "DROP TABLE cameras; VACUUM")
        self.add("database", file.read_bytes())
        database.close()

    def changes(self):
        dice = random.Random(2)
        for kind in range(32):
            self.add("solve", bytes([kind]) +
                     dice.randbytes(dice.choice((0, 8, 24, 60))))


def main():
    with tempfile.TemporaryDirectory(prefix="krot-seeds-") as scratch:
        seeds = Seeds(sys.argv[1], pathlib.Path(sys.argv[2]),
                      pathlib.Path(scratch))
        seeds.models()
        seeds.proofs()
        seeds.lists()
        seeds.options()
        seeds.databases()
        seeds.changes()


if __name__ == "__main__":
    main()
