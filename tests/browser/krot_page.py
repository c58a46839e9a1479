"""krot.html as a test uses it: gives it files, starts tasks, takes what it made."""

import pathlib
import subprocess
import tempfile
import time
import unittest
import zipfile

from browser import TAB

# Set by browser_test.py.
KROT = PAGE = SAMPLE = OPEN_BROWSER = None


def krot(*arguments):
    """(exit code, stdout, last line on stderr)"""
    result = subprocess.run([KROT, *map(str, arguments)], text=True,
                            capture_output=True)
    return (result.returncode, result.stdout,
            result.stderr.strip().split("\n")[-1])


def zipped(folder, file):
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in folder.iterdir():
            archive.write(path, "sparse/0/" + path.name)
    return file


class KrotPage(unittest.TestCase):
    """A browser with the page, and a small scene that is solved natively, too."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.root = pathlib.Path(folder.name)
        cls.downloads = cls.root / "downloads"
        cls.downloads.mkdir()
        cls.open_browser()
        krot("model_synthesizer", "--output_path", cls.root / "scene",
             "--Scene.num_frames", 8, "--Scene.num_points", 60,
             "--Scene.pixel_noise", 1, "--Scene.outlier_ratio", 0.01,
             "--output_type", "TXT")
        krot("solver", "--input_path", cls.root / "scene",
             "--output_path", cls.root / "native",
             "--certificate_path", cls.root / "native.json")

    @classmethod
    def open_browser(cls, **options):
        cls.browser = cls.enterClassContext(
            OPEN_BROWSER(downloads=cls.downloads, **options))

    def setUp(self):
        for file in self.downloads.glob("*"):
            file.unlink()
        self.browser.open(PAGE.as_uri())

    def tearDown(self):
        self.assertEqual(self.browser.console(), [])
        self.assertEqual(self.foreign_requests(), [], "asked the network")

    def foreign_requests(self):
        return [url for url in self.browser.requests()
                if not url.startswith((PAGE.as_uri(), "blob:", "data:"))]

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
        self.wait_until_read()

    def wait_until_read(self):
        self.wait_for("document.querySelector('#run').hidden && "
                      "!/^(Reading …)?$/.test("
                      "document.querySelector('#model').textContent)")

    def submit(self, task):
        self.browser.run("""
            document.querySelector('#result').hidden = true;
            document.querySelector(arguments[0]).requestSubmit();""", task)
        return self.wait_for_result()

    def wait_for_result(self):
        """Its sentence."""
        self.wait_for("!document.querySelector('#result').hidden")
        return self.browser.text("#sentence")

    def is_wrong(self, selector):
        return "wrong" in self.browser.run(
            "return document.querySelector(arguments[0]).className", selector)

    def download(self, name):
        self.browser.run("""
            [...document.querySelectorAll('#downloads a')]
                .find((link) => link.download === arguments[0]).click()""", name)
        return self.wait_for_download(name)

    def wait_for_download(self, name):
        file = self.downloads / name
        end = time.time() + 20
        while time.time() < end:  # an empty file keeps the name, at first
            if (file.exists() and file.stat().st_size > 0 and
                    not list(self.downloads.glob("*.part"))):
                return file
            time.sleep(0.05)
        self.fail("no download of " + name)

    def unpack(self, file):
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.root))
        with zipfile.ZipFile(file) as archive:
            archive.extractall(folder)
        return folder / "result"

    def tab_to(self, selector):
        """By keyboard alone, forwards: past the last is the browser's own."""
        for _ in range(60):
            if self.browser.run("return document.activeElement.matches("
                                "arguments[0])", selector):
                return
            self.browser.press(TAB)
        self.fail("Tab does not reach " + selector)
