"""Every page of docs/recipes does on the sample what it says, command by command.

Usage: recipes_test.py KROT ROOT   (the executable, the project; exit code 77:
no COLMAP here)
"""

import math
import os
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

KROT = ROOT = None
SKIPPED = 77


def write_grey_photo(path, width, height):
    """A PNG of one colour: undistortion reads photos, whatever they show."""
    def chunk(kind, data):
        return (struct.pack(">I", len(data)) + kind + data
                + struct.pack(">I", zlib.crc32(kind + data)))
    rows = (b"\0" + b"\x80" * width) * height
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
        + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


class Recipes(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        model = self.folder / "sparse" / "0"
        model.mkdir(parents=True)
        for file in (ROOT / "tools" / "sample" / "model").glob("*.bin"):
            shutil.copy(file, model)
        self.environment = dict(
            os.environ, QT_QPA_PLATFORM="offscreen",
            PATH=f"{KROT.parent}:{os.environ['PATH']}")
        (self.folder / "text").mkdir()
        self.shell("colmap model_converter --input_path sparse/0"
                   " --output_path text --output_type TXT")
        self.images = self.read_images()

    def shell(self, commands):
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", commands], cwd=self.folder,
            env=self.environment, text=True, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT)
        self.assertEqual(done.returncode, 0, f"{commands}\n{done.stdout}")
        return done.stdout

    def read_images(self):
        """Names and projection centres."""
        lines = [line.split() for line in
                 (self.folder / "text/images.txt").read_text().splitlines()
                 if not line.startswith("#")]
        images = {}
        for words in lines[::2]:
            w, x, y, z = map(float, words[1:5])
            t = [float(word) for word in words[5:8]]
            rotation = [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
            images[words[9]] = [
                -sum(rotation[i][j] * t[i] for i in range(3)) for j in range(3)]
        return images

    def cook(self, page):
        text = (ROOT / "docs" / "recipes" / page).read_text()
        self.assertLessEqual(len(text.splitlines()), 60)
        blocks = re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S)
        self.assertTrue(blocks)
        return "".join(self.shell(block) for block in blocks)

    def turn(self, name, degrees):
        """Turns an image of the model about its optical axis."""
        path = self.folder / "text/images.txt"
        lines = path.read_text().splitlines()
        n = next(n for n, line in enumerate(lines) if line.endswith(" " + name))
        words = lines[n].split()
        w, x, y, z, *t = map(float, words[1:8])
        c, s = (f(math.radians(degrees) / 2) for f in (math.cos, math.sin))
        q = [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w]
        c, s = c * c - s * s, 2 * c * s
        t = [c * t[0] - s * t[1], s * t[0] + c * t[1], t[2]]
        lines[n] = " ".join(words[:1] + [*map(repr, q + t)] + words[8:])
        path.write_text("\n".join(lines) + "\n")
        self.shell("rm sparse/0/*; cp text/*.txt sparse/0")

    def test_which_cameras_are_wrong(self):
        self.turn("view20.png", 2)
        said = self.cook("which_cameras_are_wrong.md")
        self.assertIn("1 of 24 images", said)
        self.assertIn("view20.png", said)
        self.assertIn("no image is", said)  # of the cured
        self.assertTrue((self.folder / "checked.html").exists())

    def test_splatting(self):
        camera = (self.folder / "text/cameras.txt").read_text().splitlines()[-1]
        width, height = map(int, camera.split()[2:4])
        (self.folder / "images").mkdir()
        for name in self.images:
            write_grey_photo(self.folder / "images" / name, width, height)
        self.cook("splatting.md")
        self.assertEqual(
            {file.name for file in (self.folder / "splat/images").iterdir()},
            set(self.images))
        self.assertTrue((self.folder / "splat/sparse/0/points3D.bin").exists())

    def test_gps(self):
        # Ten metres a unit, in another place; one image has no position.
        positions = {name: [10 * x + 100, 10 * y - 50, 10 * z + 7]
                     for name, (x, y, z) in self.images.items()}
        first = next(iter(positions))
        lines = [" ".join([name, *map(str, centre)])
                 for name, centre in positions.items() if name != first]
        (self.folder / "gps.txt").write_text("\n".join(lines) + "\n")
        self.cook("gps.md")
        self.shell("mkdir after; colmap model_converter --output_type TXT"
                   " --input_path sparse/gps --output_path text")
        for name, centre in self.read_images().items():
            for value, expected in zip(centre, positions[name]):
                self.assertAlmostEqual(value, expected, delta=3)

    def test_compare_in_the_gui(self):
        self.assertIn("RMS", self.cook("compare_in_the_gui.md"))

    def test_no_other_page(self):
        pages = {path.stem for path in (ROOT / "docs" / "recipes").glob("*.md")}
        tested = {name[len("test_"):] for name in dir(self)
                  if name.startswith("test_")}
        self.assertLessEqual(pages, tested)


def main():
    global KROT, ROOT
    KROT, ROOT = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    if shutil.which("colmap") is None:
        print("skipped: colmap is not installed")
        return SKIPPED
    return 0 if unittest.main(argv=sys.argv[:1], exit=False).result.wasSuccessful() else 1


if __name__ == "__main__":
    sys.exit(main())
