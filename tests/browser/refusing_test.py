"""What is no model is refused in the command line's own words (docs/errors.md)."""

import shutil
import zipfile

import krot_page
from krot_page import KrotPage, krot


class Refusing(KrotPage):

    def changed(self, name, old, new):
        """A copy of the scene with the first `old` after the comments replaced
        in that file."""
        folder = self.root / "changed"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.root / "scene", folder)
        lines = (folder / name).read_text().splitlines(keepends=True)
        start = next(i for i, line in enumerate(lines) if line[0] != "#")
        text = "".join(lines[start:])
        self.assertIn(old, text)
        (folder / name).write_text(
            "".join(lines[:start]) + text.replace(old, new, 1))
        return folder

    def assert_refused_alike(self, folder):
        code, _, last = krot("model_analyzer", "--path", folder)
        self.assertEqual(code, 2)
        self.give(folder)
        self.assertEqual(self.browser.text("#model"),
                         last.replace(str(folder), "model"))
        self.assertTrue(self.is_wrong("#model"))
        self.assertTrue(self.browser.run(
            "return document.querySelector('#tasks').hidden"))

    def test_binary_files_that_end_early(self):
        cut = self.root / "cut"
        cut.mkdir()
        for file in krot_page.SAMPLE.glob("*.bin"):
            (cut / file.name).write_bytes(file.read_bytes()[:1000])
        self.assert_refused_alike(cut)

    def test_half_a_model(self):
        half = self.changed("points3D.txt", " ", " ")
        (half / "points3D.txt").unlink()
        self.assert_refused_alike(half)

    def test_rigs_without_frames(self):
        folder = self.changed("cameras.txt", " ", " ")
        shutil.copy(folder / "cameras.txt", folder / "rigs.txt")
        self.assert_refused_alike(folder)

    def test_words_that_do_not_belong_there(self):
        for change in (("cameras.txt", "SIMPLE_RADIAL", "SIMPLE_RADIATOR"),
                       ("cameras.txt", " 1024 ", " wide "),
                       ("points3D.txt", " ", " nan "),
                       ("points3D.txt", "\n", " 1\n")):
            with self.subTest(change):
                self.assert_refused_alike(self.changed(*change))

    def test_records_that_do_not_agree(self):
        self.assert_refused_alike(self.changed("cameras.txt", "1 ", "77 "))

    def test_nothing_to_solve(self):
        folder = self.changed("points3D.txt", " ", " ")
        (folder / "points3D.txt").write_text("")
        code, _, last = krot("solver", "--input_path", folder,
                             "--output_path", self.root / "none")
        self.assertEqual(code, 3)
        self.give(folder)
        self.assertEqual(self.submit("#solve"),
                         last.replace(str(folder), "model"))
        self.assertTrue(self.is_wrong("#sentence"))

    def test_files_that_are_none_of_a_models(self):
        self.give(krot_page.KROT.parent / "CMakeCache.txt", "#choose-files")
        self.assertEqual(
            self.browser.text("#model"),
            "CMakeCache.txt: found no cameras.bin or cameras.txt, expected the "
            "files of a COLMAP sparse model")

    def test_a_zip_that_is_none(self):
        file = self.root / "model.zip"
        file.write_bytes(b"PK\3\4 and no more")
        self.give(file, "#choose-files")
        self.assertEqual(self.browser.text("#model"),
                         "model.zip: found no zip archive, or a damaged one")

    def test_a_zip_of_two_models(self):
        file = self.root / "two.zip"
        with zipfile.ZipFile(file, "w") as archive:
            for folder in ("sparse/0/", "sparse/1/"):
                for path in (self.root / "scene").iterdir():
                    archive.write(path, folder + path.name)
        self.give(file, "#choose-files")
        self.assertEqual(
            self.browser.text("#model"),
            "Found 2 models (sparse/0/, sparse/1/), expected one: drop its own "
            "folder")
