"""krot.html in a real browser: what it computes is what the command line does.

Usage: browser_test.py KROT KROT_HTML SAMPLE_MODEL   (exit code 77: no browser)
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest
import zipfile

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "page"))
import webdriver  # noqa: E402

SKIPPED = 77


def krot(*arguments):
    """(exit code, stdout, last line on stderr)"""
    result = subprocess.run([KROT, *map(str, arguments)], text=True,
                            capture_output=True)
    return (result.returncode, result.stdout,
            result.stderr.strip().split("\n")[-1])


class BrowserTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.root = pathlib.Path(folder.name)
        cls.downloads = cls.root / "downloads"
        cls.browser = cls.enterClassContext(
            webdriver.Browser(downloads=cls.downloads))
        krot("model_synthesizer", "--output_path", cls.root / "scene",
             "--Scene.num_frames", 12, "--Scene.num_points", 300,
             "--Scene.pixel_noise", 1, "--Scene.outlier_ratio", 0.01,
             "--output_type", "TXT")
        krot("solver", "--input_path", cls.root / "scene",
             "--output_path", cls.root / "native",
             "--certificate_path", cls.root / "native.json")

    def setUp(self):
        for file in self.downloads.glob("*"):
            file.unlink()
        self.browser.open(PAGE.as_uri())

    def tearDown(self):
        self.assertEqual(self.browser.console(), [])
        foreign = [url for url in self.browser.requests()
                   if not url.startswith((PAGE.as_uri(), "blob:", "data:"))]
        self.assertEqual(foreign, [], "asked the network")

    def wait_for(self, condition, seconds=100):
        end = time.time() + seconds
        while time.time() < end:
            if self.browser.run("return Boolean(%s)" % condition):
                return
            time.sleep(0.1)
        self.fail("still waiting for " + condition + ": " +
                  self.browser.text("main"))

    def give(self, path, selector="#choose-folder"):
        self.browser.choose(selector, path)
        self.wait_for("document.querySelector('#run').hidden && "
                      "!/^(Reading …)?$/.test("
                      "document.querySelector('#model').textContent)")

    def submit(self, task):
        self.browser.run("document.querySelector(arguments[0]).requestSubmit()",
                         task)
        self.wait_for("!document.querySelector('#result').hidden")
        return self.browser.text("#sentence")

    def download(self, name):
        self.browser.run("""
            [...document.querySelectorAll('#downloads a')]
                .find((link) => link.download === arguments[0]).click()""", name)
        file = self.downloads / name
        end = time.time() + 20
        while time.time() < end:  # an empty file keeps the name, at first
            if file.exists() and file.stat().st_size > 0:
                return file
            time.sleep(0.05)
        self.fail("no download of " + name)

    def unpack(self, file):
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.root))
        with zipfile.ZipFile(file) as archive:
            archive.extractall(folder)
        return folder / "result"

    def zipped_scene(self):
        file = self.root / "scene.zip"
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for path in (self.root / "scene").iterdir():
                archive.write(path, "sparse/0/" + path.name)
        return file

    def test_tells_what_the_model_is(self):
        self.give(SAMPLE)
        self.assertIn("24 images, 6,718 points, 30,978 observations; largest "
                      "error 3.7419 px", self.browser.text("#model"))

    def test_solves_the_sample_as_the_command_line_does(self):
        self.give(SAMPLE)
        sentence = self.submit("#solve")
        self.assertRegex(sentence, r"^Maximum 3\.209\d px, proved to be within")
        model = self.unpack(self.download("result.zip"))
        self.assertEqual({file.name for file in model.iterdir()},
                         {file.name for file in SAMPLE.glob("*.bin")})
        code, _, _ = krot("certificate_checker", "--input_path", model,
                          "--certificate_path",
                          self.download("certificate.json"))
        self.assertEqual(code, 0, "a proof that the native checker refuses")
        report = json.loads(self.download("report.json").read_text())
        self.assertEqual(report["termination"], "gap_reached")
        self.assertIn("KROT: ", self.browser.run(
            "return await new Promise((done) => setTimeout(() => done("
            "document.querySelector('#report').contentDocument?.title ?? "
            "'KROT: (another origin)'), 500))"))

    def test_reads_a_zip_and_writes_text_for_text(self):
        self.give(self.zipped_scene(), "#choose-files")
        self.assertIn("12 images", self.browser.text("#model"))
        self.submit("#solve")
        model = self.unpack(self.download("result.zip"))
        self.assertTrue((model / "images.txt").exists())
        _, native, _ = krot("model_analyzer", "--path", self.root / "native")
        _, here, _ = krot("model_analyzer", "--path", model)
        largest = [float(text.split("True reprojection errors, pixels")[1]
                         .split()[5 + 2]) for text in (native, here)]
        self.assertAlmostEqual(largest[0], largest[1], delta=2e-3 * largest[0])

    def test_finds_wrong_observations_and_offers_every_bound(self):
        self.give(self.root / "scene")
        sentence = self.submit("#filter")
        self.assertRegex(sentence, r"^removed \d+ of [\d,]+; at least \d+ must go")
        self.browser.run("""
            const slider = document.querySelector('#level');
            slider.value = 1;
            slider.dispatchEvent(new Event('input'));
            document.querySelector('#take').click();""")
        self.wait_for("document.querySelector('#result').hidden")
        self.wait_for("!document.querySelector('#result').hidden")
        self.assertRegex(self.browser.text("#sentence"), r"^removed \d+ of")
        code, _, _ = krot("certificate_checker", "--input_path",
                          self.root / "scene", "--certificate_path",
                          self.download("conflicts.json"))
        self.assertEqual(code, 0)

    def test_judges_proofs_as_the_command_line_does(self):
        self.give(self.root / "scene")
        wrong = self.root / "wrong.json"
        text = (self.root / "native.json").read_text()
        bound = json.loads(text)["lower_bound"]
        wrong.write_text(text.replace(str(bound), str(1.5 * bound)))
        for file in (self.root / "native.json", wrong):
            self.browser.choose("#check input", file)
            sentence = self.submit("#check")
            code, table, last = krot("certificate_checker", "--input_path",
                                     self.root / "scene", "--certificate_path",
                                     file)
            said = " ".join(table.split()) or last.split(": ", 1)[1]
            self.assertTrue(said.startswith(sentence.split(": ", 1)[-1]
                                            if code else sentence), sentence)
            self.assertEqual(self.browser.run(
                "return document.querySelector('#sentence').className"),
                "" if code == 0 else "wrong")

    def test_compares_two_models(self):
        self.give(self.root / "native")
        self.browser.choose("#compare input", self.zipped_scene())
        self.assertEqual(self.submit("#compare"),
                         "How the two differ stands in the report.")
        self.assertIn("True reprojection errors, pixels", self.browser.text("#table"))

    def test_says_what_is_wrong_with_the_files(self):
        cut = self.root / "cut"
        cut.mkdir(exist_ok=True)
        for file in SAMPLE.glob("*.bin"):
            (cut / file.name).write_bytes(file.read_bytes()[:1000])
        self.give(cut)
        _, _, last = krot("model_analyzer", "--path", cut)
        self.assertEqual(self.browser.text("#model").split("/")[-1],
                         last.split("/")[-1])
        self.give(KROT.parent / "CMakeCache.txt", "#choose-files")
        self.assertIn("found no cameras.bin", self.browser.text("#model"))

    def test_is_left_alone_when_cancelled(self):
        self.give(SAMPLE)
        self.browser.run("document.querySelector('#solve').requestSubmit()")
        self.wait_for("!document.querySelector('#run').hidden")
        self.browser.run("document.querySelector('#cancel').click()")
        self.wait_for("document.querySelector('#run').hidden")
        self.assertTrue(self.browser.run(
            "return document.querySelector('#result').hidden"))
        self.assertIn("Maximum", self.submit("#solve"))


if __name__ == "__main__":
    program = webdriver.missing_program()
    if program:
        print("skipped: no " + program)
        sys.exit(SKIPPED)
    KROT, PAGE, SAMPLE = (pathlib.Path(path).resolve() for path in sys.argv[1:4])
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
