"""The report page in a real browser: what it shows is what report.json says.

Usage: page_test.py KROT   (the executable; exit code 77: no browser here)

With KROT_SAMPLE_PHOTOS, the folder images/ of tools/sample/render.sh, outliers
planted in the sample are looked for in its photos, too.
"""

import itertools
import json
import math
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

from chromium import Chromium
import plant

KROT = None
BROWSER = None  # one for all tests: software takes a second to draw a page's view
SKIPPED = 77

# Were it taken for markup, it would end the script and make an element.
HOSTILE_NAME = """</script><b id="injected">&lt;it's "quoted" \\u003c"""


# Has the view drawn anew, once it has its size, and reads it in the same frame,
# since later it is gone. `copy`: a canvas with what it shows.
COPY = """
const canvas = document.querySelector('#scene canvas');
const slider = document.querySelector('#scene input[type=range]');
const frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
await frame();
slider.dispatchEvent(new Event('input'));
await frame();
const { width, height } = canvas;
const copy = document.createElement('canvas');
Object.assign(copy, { width, height });
const context = copy.getContext('2d');
context.drawImage(canvas, 0, 0);
"""
PICTURE = COPY + "return copy.toDataURL();"
DRAWN = COPY + """
const what = arguments[0];
const style = getComputedStyle(document.documentElement);
const isColor = (pixel, name) => {
  const hex = style.getPropertyValue(name).trim();
  return [0, 1, 2].every((i) => Math.abs(
      pixel[i] - parseInt(hex.slice(2 * i + 1, 2 * i + 3), 16)) < 12);
};
const isWanted = (pixel) => pixel[3] > 128 && (what === 'a point' ?
    !isColor(pixel, '--after') && !isColor(pixel, '--mark') :
    isColor(pixel, what));
const { data } = context.getImageData(0, 0, width, height);
const places = [];
for (let i = 0; i < data.length; i += 4) {
  if (!isWanted(data.subarray(i, i + 4))) continue;
  places.push([Math.floor((i / 4) % width - width / 2),
               Math.floor(i / 4 / width - height / 2)]);
}
return places;
"""

# The colour of every photo on the page where its point was observed.
READ_CROPS = """
return [...document.querySelectorAll('#suspects img')].map((image, i) => {
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = image.naturalWidth;
  const context = canvas.getContext('2d');
  context.drawImage(image, 0, 0);
  const [x, y] = arguments[0][i].crop.observed.map(Math.floor);
  return [...context.getImageData(x, y, 1, 1).data];
});
"""


def step_heights(browser, chart):
    """Of a chart's steps, from the top."""
    return browser.run("""
        return [...document.querySelectorAll(
            arguments[0] + ' circle.after.step')].map(
                (step) => Number(step.getAttribute('cy')))""", chart)


def run_krot(*arguments):
    subprocess.run([KROT, *map(str, arguments), "--log_level", "0"],
                   check=True, stdout=subprocess.DEVNULL)


def pixels(value):
    return "%.4f" % value


def rounded_down(value):
    return "%.4f" % (math.floor(value * 1e4) / 1e4)


class PageTest(unittest.TestCase):
    """Its tests share a folder, and leave the browser's console empty."""

    browser = property(lambda _: BROWSER)

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.root = pathlib.Path(folder.name)

    @classmethod
    def synthesize(cls, num_frames, num_points, *options):
        run_krot("model_synthesizer", "--output_path", cls.root / "input",
                 "--Scene.num_frames", num_frames,
                 "--Scene.num_points", num_points, *options)

    @classmethod
    def run_with_page(cls, command, *options):
        """Of a command that reads the input: its report, and the page."""
        page, report = (cls.root / f"{command}.{end}"
                        for end in ("html", "json"))
        run_krot(command, "--input_path", cls.root / "input", *options,
                 "--report_path", report, "--html_path", page)
        return json.loads(report.read_text()), page.as_uri()

    def tearDown(self):
        self.assertEqual(self.browser.console(), [])


class SolvedScene(PageTest):
    """A scene with rigs, noise and distortion, solved."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        root = cls.root
        cls.synthesize(8, 200, "--Scene.pixel_noise", 1,
                       "--Scene.start_point_noise", 0.002, "--output_type",
                       "TXT")
        cls.rename_an_image(root / "input" / "images.txt")
        cls.report, cls.page = cls.run_with_page("solver", "--output_path",
                                                 root / "output")
        cls.image_errors = {}
        cls.point_errors = {}
        for end, model in (("before", "input"), ("after", "output")):
            cls.analyze(end, root / model)

    @staticmethod
    def rename_an_image(file):
        lines = file.read_text().splitlines(keepends=True)
        first = next(i for i, line in enumerate(lines) if line[0] != "#")
        fields = lines[first].split(maxsplit=9)
        lines[first] = " ".join(fields[:9] + [HOSTILE_NAME]) + "\n"
        file.write_text("".join(lines))

    @classmethod
    def analyze(cls, end, model):
        """Another command's figures of the models, to compare with."""
        file = cls.root / f"{end}.json"
        run_krot("model_analyzer", "--path", model, "--report_path", file,
                 "--num_worst", 1000000)
        analysis = json.loads(file.read_text())
        cls.image_errors[end] = {
            image["image_name"]: image["pixel_error"]
            for image in analysis["images"]}
        largest = {}
        for seen in analysis["worst"]:
            largest.setdefault(seen["point3D_id"], seen["error_px"])
        cls.point_errors[end] = largest


class ReadTest(SolvedScene):
    """What the page shows as soon as it is open."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        BROWSER.open(cls.page)

    def test_holds_the_report_as_it_was_written(self):
        held = json.loads(self.browser.text("#krot-report"))
        self.assertEqual(held, self.report)

    def test_takes_no_name_for_markup(self):
        self.assertIn(HOSTILE_NAME,
                      self.browser.texts("#images td:first-child"))
        self.assertEqual(self.browser.texts("#injected"), [])

    def test_loads_nothing(self):
        self.assertEqual(self.browser.run(
            "return performance.getEntriesByType('resource').length"), 0)

    def test_verdict_says_what_was_reached_and_proved(self):
        errors = self.report["pixel_error"]
        verdict = self.browser.text("#verdict")
        self.assertIn("fell from %.2f px to %.2f px" % (
            errors["before"]["max"], errors["after"]["max"]), verdict)
        self.assertIn(self.report["verdict"], verdict)

    def test_error_table_shows_the_numbers_of_the_report(self):
        for end in ("before", "after"):
            for key in ("max", "p99", "mean", "rms"):
                with self.subTest(key=key, end=end):
                    self.assertEqual(
                        self.browser.text(f"#error-{key}-{end}"),
                        pixels(self.report["pixel_error"][end][key]))

    def test_error_table_has_the_cost_only_if_it_is_no_maximum(self):
        costs = [pixels(self.report[key])
                 for key in ("cost_initial", "cost_final")]
        maximum = pixels(self.report["pixel_error"]["after"]["max"])
        shown = [text for end in ("before", "after")
                 for text in self.browser.texts(f"#error-cost-{end}")]
        self.assertEqual(shown, [] if costs[1] == maximum else costs)

    def test_cards_show_the_bound_and_the_observations(self):
        self.assertEqual(self.browser.text("#card-bound"),
                         rounded_down(self.report["lower_bound"]))
        self.assertEqual(self.browser.text("#card-observations"),
                         "{:,}".format(self.report["num_observations"]))

    def test_support_is_listed_as_in_the_report(self):
        rows = self.browser.run("""
            return [...document.querySelectorAll('#support tbody tr')].map(
                (row) => [...row.cells].map((cell) => cell.textContent))""")
        self.assertEqual(
            [[row[0], row[1], row[2], row[4]] for row in rows],
            [[seen["image_name"], str(seen["point3D_id"]),
              str(seen["point2D_idx"]), pixels(seen["error_px"])]
             for seen in self.report["support"]])

    def test_histogram_counts_every_observation(self):
        models = json.loads(self.browser.text("#krot-models"))
        for model in models.values():
            self.assertEqual(sum(model["histogram"]["counts"]),
                             model["num_observations"])
            self.assertEqual(model["tail"][-1][0], model["num_observations"])
        self.assertEqual(models["after"]["tail"][0][1],
                         self.report["pixel_error"]["after"]["max"])

    def test_worst_image_has_the_largest_error_of_all(self):
        first = self.browser.texts("#images tbody tr:first-child td")
        self.assertEqual(first[3],
                         pixels(self.report["pixel_error"]["after"]["max"]))


class UseTest(SolvedScene):
    """What it shows when it is clicked and turned."""

    def setUp(self):
        self.browser.open(self.page)

    def test_click_on_a_camera_shows_its_numbers(self):
        self.switch("#scene input[type=checkbox]")  # no lines of the support
        place = self.drawn("--after")[0]
        self.browser.click("#scene canvas", *place)
        name = self.browser.text(".info h3")
        self.assertEqual(
            self.browser.texts(".info tbody tr:first-child td")[1:],
            [pixels(self.image_errors[end][name]["max"])
             for end in ("before", "after")])
        marks = self.drawn("--mark")
        self.assertLess(min(math.dist(place, mark) for mark in marks), 10)
        self.assertLess(max(math.dist(place, mark) for mark in marks), 150)

    def test_click_on_a_point_shows_its_numbers(self):
        self.switch("#scene input[type=checkbox]")
        self.browser.click("#scene canvas", *self.drawn("a point")[0])
        title = self.browser.text(".info h3")
        self.assertRegex(title, r"^Point \d+$")
        shown = self.browser.texts(".info tbody tr:first-child td")[1:]
        for end, text in zip(("before", "after"), shown):
            largest = self.point_errors[end][int(title.split()[1])]
            self.assertAlmostEqual(float(text), largest, delta=0.6e-4)

    def test_choice_of_a_support_row_shows_its_camera_and_point(self):
        self.browser.click("#support tbody tr:first-child td:first-child")
        worst = self.report["support"][0]
        self.assertEqual(
            self.browser.texts(".info h3"),
            [worst["image_name"], "Point %d" % worst["point3D_id"]])

    def test_click_beside_everything_closes_the_numbers(self):
        self.browser.click("#support tbody tr:first-child td:first-child")
        self.browser.run("document.querySelector('#scene canvas')"
                         ".scrollIntoView({block: 'center', behavior: 'instant'});")
        self.browser.click("#scene canvas", -500, -200)
        self.assertEqual(self.browser.texts(".info"), [])

    def test_drag_turns_the_view(self):
        before = self.picture()
        self.browser.drag("#scene canvas", (80, 30))
        self.assertNotEqual(self.picture(), before)

    def test_models_and_colours_can_be_changed(self):
        seen = {self.picture()}
        for choice in ("before", "both", "after", "error"):
            self.switch(f"input[value={choice}]")
            seen.add(self.picture())
        self.assertEqual(len(seen), 4)  # after, before, both; after by error

    def switch(self, selector):
        self.browser.run(
            "document.querySelector(arguments[0]).click()", selector)

    def picture(self):
        """What the canvas shows."""
        return self.browser.run(PICTURE)

    def drawn(self, what):
        """Where the canvas shows a colour of the style sheet, or "a point":
        what has another colour than cameras and marks. CSS pixels from its
        centre."""
        return self.browser.run(DRAWN, what)


class OtherCommandsTest(PageTest):
    """The pages of the commands that solve nothing."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.synthesize(8, 60, "--ground_truth_path", cls.root / "truth",
                       "--Scene.pixel_noise", 1, "--Scene.start_point_noise",
                       0.002)

    def open_page_of(self, *arguments):
        page = self.root / "page.html"
        report = self.root / "report.json"
        run_krot(*arguments, "--html_path", page, "--report_path", report)
        self.browser.open(page.as_uri())
        return json.loads(report.read_text())

    def assert_errors_are(self, before, after):
        for end, errors in (("before", before), ("after", after)):
            for key in ("max", "p99", "mean", "rms"):
                self.assertEqual(self.browser.text(f"#error-{key}-{end}"),
                                 pixels(errors[key]))

    def test_bundle_adjuster_shows_how_both_errors_moved(self):
        report = self.open_page_of(
            "bundle_adjuster", "--input_path", self.root / "input",
            "--output_path", self.root / "adjusted")
        before, after = (report["pixel_error"][end]
                         for end in ("before", "after"))
        self.assertIn("error fell from %.4f px to %.4f px" %
                      (before["rms"], after["rms"]),
                      self.browser.text("#verdict"))
        self.assert_errors_are(before, after)

    def test_bundle_adjuster_shows_how_its_cost_fell(self):
        for cap in ([], ["--BundleAdjustment.max_error_factor", 1.1]):
            with self.subTest(cap=cap):
                report = self.open_page_of(
                    "bundle_adjuster", "--input_path", self.root / "input",
                    "--output_path", self.root / "adjusted",
                    "--overwrite", 1, *cap)
                costs = [report["cost_initial"]] + [
                    step["cost"] for step in report["iterations"]]
                heights = step_heights(self.browser, "#convergence")
                self.assertEqual(len(heights), len(costs))
                self.assertEqual(len(heights), report["num_iterations"] + 1)
                for i, j in itertools.permutations(range(len(costs)), 2):
                    if costs[i] > costs[j] * (1 + 1e-9):
                        self.assertLess(heights[i], heights[j])

    def test_solver_shows_the_polished_model_where_that_is_written(self):
        report = self.open_page_of(
            "solver", "--input_path", self.root / "input", "--output_path",
            self.root / "polished", "--Solver.polish", "rotations_fixed")
        polished = report["polish"]["pixel_error"]
        self.assertIn("polish by least squares: the largest error",
                      self.browser.text("#verdict"))
        self.assert_errors_are(report["pixel_error"]["before"], polished)
        models = json.loads(self.browser.text("#krot-models"))
        self.assertAlmostEqual(models["after"]["tail"][0][1], polished["max"],
                               delta=1e-12)

    def test_model_comparer_shows_both_models_and_their_differences(self):
        report = self.open_page_of(
            "model_comparer", "--input_path1", self.root / "input",
            "--input_path2", self.root / "truth")
        first, second = (report["pixel_error"][model]
                         for model in ("model1", "model2"))
        self.assertEqual(
            self.browser.text("#verdict"),
            "The largest error of model 1 is %.2f px, of model 2 %.2f px." %
            (first["max"], second["max"]))
        self.assert_errors_are(first, second)
        shown = self.browser.texts("#differences td:nth-child(3)")
        for text, key in zip(shown, ("rotation_deg", "center", "point")):
            self.assertAlmostEqual(float(text), report[key]["max"],
                                   delta=1e-3 * report[key]["max"])


def write_png(path, width, height, color):
    """color(x, y) -> (red, green, blue)"""
    def chunk(kind, data):
        return (struct.pack(">I", len(data)) + kind + data +
                struct.pack(">I", zlib.crc32(kind + data)))
    rows = b"".join(
        b"\0" + bytes(itertools.chain.from_iterable(
            color(x, y) for x in range(width))) for y in range(height))
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n" +
        chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
        chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b""))


class FilterTest(PageTest):
    """A scene with planted outliers, and photos whose colours say where they
    are: red is a quarter of x, green of y."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        root = cls.root
        cls.synthesize(6, 100, "--Scene.pixel_noise", 0.5,
                       "--Scene.outlier_ratio", 0.02, "--output_type", "TXT")
        cls.pixels = {}
        lines = [line for line in (root / "input" / "images.txt").read_text()
                 .splitlines() if not line.startswith("#")]
        (root / "photos").mkdir()
        first = None
        for header, points in zip(lines[::2], lines[1::2]):
            name = header.split(maxsplit=9)[9]
            values = points.split()
            cls.pixels[name] = [
                (float(values[i]), float(values[i + 1]))
                for i in range(0, len(values), 3)]
            photo = root / "photos" / name
            photo.parent.mkdir(parents=True, exist_ok=True)
            if first is None:
                first = photo
                write_png(photo, 1024, 768,
                          lambda x, y: (x // 4, y // 4, 128))
            else:
                shutil.copy(first, photo)
        cls.report, cls.page = cls.run_with_page(
            "outlier_filter", "--output_path", root / "output",
            "--image_path", root / "photos",
            "--OutlierFilter.profile_path", root / "profile.json")

    def setUp(self):
        self.browser.open(self.page)

    def test_verdict_is_the_bracket(self):
        verdict = self.browser.text("#verdict")
        self.assertIn("Without %d of " % self.report["num_removed"], verdict)
        self.assertIn("at least %d must go (proved)" %
                      self.report["num_must_go"], verdict)

    def test_profile_shows_every_level(self):
        levels = self.report["profile"]["levels"]
        self.assertEqual(
            self.browser.texts("#profile tbody td:nth-child(3)"),
            [pixels(level["max_error"]) for level in levels])
        heights = step_heights(self.browser, "#profile-chart")
        self.assertEqual(len(heights), len(levels))
        self.assertEqual(heights, sorted(heights))

    def test_each_level_marks_its_points(self):
        levels = self.report["profile"]["levels"]
        self.browser.run(
            "document.querySelector('input[value=before]').click()")
        areas = []
        for level in (0, len(levels) - 1):
            self.browser.run("window.postMessage({level: arguments[0]}, '*');"
                             "await new Promise(requestAnimationFrame)", level)
            self.assertIn("%d observation" % levels[level]["num_removed"],
                          self.browser.text("#scene output"))
            areas.append(len(self.browser.run(DRAWN, "--mark")))
        self.assertEqual(areas[0], 0)
        self.assertGreater(areas[1], 0)

    def test_crops_show_the_place_of_the_observation(self):
        crops = json.loads(self.browser.text("#krot-crops"))
        self.assertEqual(
            [crop["point3D_id"] for crop in crops],
            list(dict.fromkeys(seen["point3D_id"]
                               for seen in self.report["removed"]))[:20])
        views = [view for crop in crops for view in crop["views"]]
        colors = self.browser.run(READ_CROPS, views)
        self.assertEqual(len(colors), len(views))
        for view, color in zip(views, colors):
            x, y = self.pixels[view["image_name"]][view["point2D_idx"]]
            self.assertAlmostEqual(4 * color[0], x, delta=12)
            self.assertAlmostEqual(4 * color[1], y, delta=12)

    def test_choice_of_a_suspect_shows_its_camera_and_point(self):
        self.browser.run(
            "document.querySelector('#suspects button').click()")
        worst = self.report["removed"][0]
        self.assertEqual(
            self.browser.texts(".info h3"),
            [worst["image_name"], "Point %d" % worst["point3D_id"]])


@unittest.skipUnless("KROT_SAMPLE_PHOTOS" in os.environ,
                     "KROT_SAMPLE_PHOTOS is not set")
class RenderedSceneTest(unittest.TestCase):
    """The sample, with observations moved by dozens of pixels, in its rendered
    photos."""

    def test_planted_outliers_are_shown_in_their_photos(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            sample = pathlib.Path(__file__).parents[2] / "tools/sample/model"
            run_krot("solver", "--input_path", sample, "--output_path",
                     root / "input", "--output_type", "TXT")
            planted = plant.plant_outliers(root / "input", 12)
            run_krot("outlier_filter", "--input_path", root / "input",
                     "--output_path", root / "output", "--image_path",
                     os.environ["KROT_SAMPLE_PHOTOS"],
                     "--OutlierFilter.max_error", 3.3, "--report_path",
                     root / "report.json", "--html_path", root / "page.html")
            report = json.loads((root / "report.json").read_text())
            removed = {(seen["image_name"], seen["point2D_idx"])
                       for seen in report["removed"]}
            self.assertLessEqual(set(planted), removed)
            self.assertLessEqual(report["num_must_go"], len(planted))
            BROWSER.open((root / "page.html").as_uri())
            crops = json.loads(BROWSER.text("#krot-crops"))
            sizes = BROWSER.run("""
                return [...document.querySelectorAll('#suspects img')].map(
                    (image) => image.naturalWidth);""")
            self.assertEqual(BROWSER.console(), [])
            shown = {(crop["image_name"], crop["point2D_idx"])
                     for crop in crops}
            self.assertLessEqual(set(planted), shown)
            self.assertEqual(len(sizes),
                             sum(len(crop["views"]) for crop in crops))
            self.assertGreater(min(sizes), 0)
            for crop in crops:
                seen = crop["views"][0]
                if (crop["image_name"], crop["point2D_idx"]) not in planted:
                    continue
                x, y = planted[crop["image_name"], crop["point2D_idx"]]
                self.assertAlmostEqual(
                    math.dist(seen["crop"]["observed"],
                              seen["crop"]["projected"]),
                    math.hypot(x, y), delta=4)


class NoiseAloneTest(PageTest):
    def test_no_observation_is_called_wrong(self):
        for noise in (0, 1):
            with self.subTest(noise=noise):
                self.synthesize(6, 100, "--Scene.pixel_noise", noise,
                                "--overwrite", 1)
                _, page = self.run_with_page(
                    "outlier_filter", "--output_path", self.root / "output",
                    "--OutlierFilter.profile_path", self.root / "profile.json",
                    "--overwrite", 1)
                self.browser.open(page)
                self.assertIn("No observation is called wrong",
                              self.browser.text("#verdict"))
                self.assertNotIn("elbow", self.browser.text("#profile"))


def turned(text, row, first):
    """With the pose of a row turned: a quaternion from column `first` on,
    and a translation."""
    lines = text.splitlines()
    starts = [n for n, line in enumerate(lines)
              if not line.startswith("#")]
    n = starts[row]
    words = lines[n].split()
    w, x, y, z, t_x, t_y, t_z = map(float, words[first:first + 7])
    cos, sin = math.cos(math.radians(1)), math.sin(math.radians(1))
    half_cos, half_sin = (math.cos(math.radians(0.5)),
                          math.sin(math.radians(0.5)))
    turned = (half_cos * w - half_sin * y, half_cos * x + half_sin * z,
              half_cos * y + half_sin * w, half_cos * z - half_sin * x,
              cos * t_x + sin * t_z, t_y, cos * t_z - sin * t_x)
    words[first:first + 7] = map(repr, turned)
    lines[n] = " ".join(words)
    return "\n".join(lines) + "\n"


def turn_a_camera(model):
    for name, row, first in (("images.txt", 4, 1), ("frames.txt", 2, 2)):
        path = model / name
        path.write_text(turned(path.read_text(), row, first))


class RotationSuspectTest(PageTest):
    """A scene in which one camera is turned by a degree about its own axis."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        root = cls.root
        cls.synthesize(6, 150, "--Scene.pixel_noise", 0.5, "--output_type",
                       "TXT")
        turn_a_camera(root / "input")
        report, cls.page = cls.run_with_page(
            "outlier_filter", "--output_path", root / "output",
            "--OutlierFilter.max_error", 3)
        cls.suspect = report["rotation_suspect"]
        cls.checked, cls.checked_page = cls.run_with_page("model_checker")

    def test_suspect_is_named_with_the_turn_that_fits(self):
        self.browser.open(self.page)
        self.assertAlmostEqual(self.suspect["angle_deg"], 1, delta=0.1)
        text = self.browser.text("#rotation-suspect")
        self.assertIn(self.suspect["image_name"], text)
        self.assertIn("A turn by %.2f degrees" % self.suspect["angle_deg"],
                      text)
        self.browser.run(
            "document.querySelector('#rotation-suspect button').click()")
        self.assertEqual(self.browser.texts(".info h3"),
                         [self.suspect["image_name"]])

    def test_model_checker_shows_its_verdicts_in_the_scene(self):
        self.browser.open(self.checked_page)
        self.assertEqual(self.browser.text("#verdict"), self.checked["verdict"])
        wrong = [image for image in self.checked["images"]
                 if image["verdict"] == "wrong"]
        self.assertEqual([image["image_name"] for image in wrong],
                         [self.suspect["image_name"]])
        self.assertEqual(self.browser.texts("#bad-images tbody td"), [
            wrong[0]["image_name"], "wrong", str(wrong[0]["num_observations"]),
            str(wrong[0]["num_wrong"]), wrong[0]["reason"]])
        self.assertGreater(len(self.browser.run(DRAWN, "--wrong")), 0)
        self.browser.run("document.querySelector('input[value=rgb]').click()")
        self.assertEqual(self.browser.run(DRAWN, "--wrong"), [])
        self.browser.run(
            "document.querySelector('#bad-images tbody tr').click()")
        self.assertEqual(self.browser.texts(".info h3"),
                         [wrong[0]["image_name"]])


class PairsTest(PageTest):
    """A scene in which one camera is turned, with its database, and photos of
    all images but one."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        root = cls.root
        cls.synthesize(6, 300, "--database_path", root / "database.db",
                       "--Scene.pixel_noise", 0.5, "--output_type", "TXT")
        turn_a_camera(root / "input")
        run_krot("model_checker", "--input_path", root / "input",
                 "--database_path", root / "database.db", "--report_path",
                 root / "bare.json", "--html_path", root / "bare.html")
        cls.database = json.loads(
            (root / "bare.json").read_text())["database"]
        cls.bare = (root / "bare.html").as_uri()
        names = [image["image_name"] for image in cls.database["images"]]
        cls.missing = names[0]
        for name in names[1:]:
            photo = root / "photos" / name
            photo.parent.mkdir(parents=True, exist_ok=True)
            write_png(photo, 64, 48, lambda x, y: (4 * x, 4 * y, 128))
        run_krot("model_checker", "--input_path", root / "input",
                 "--database_path", root / "database.db", "--image_path",
                 root / "photos", "--html_path", root / "page.html")
        cls.page = (root / "page.html").as_uri()

    def choose(self, pair):
        """Clicks on the pair's square."""
        names = [image["image_name"] for image in self.database["images"]]
        self.browser.run("""
            const [x, y, size] = arguments;
            const matrix = document.querySelector('svg.matrix');
            const box = matrix.getBoundingClientRect();
            matrix.dispatchEvent(new MouseEvent('click', {
              clientX: box.left + (x + 0.5) / size * box.width,
              clientY: box.top + (y + 0.5) / size * box.height,
              bubbles: true,
            }));""", names.index(pair["image1"]), names.index(pair["image2"]),
                         len(names))

    def lines(self, kind):
        return len(self.browser.run(
            "return [...document.querySelectorAll("
            "`svg.pair line.${arguments[0]}`)].map(() => 1);", kind))

    def test_matrix_has_a_square_for_each_pair_on_both_sides(self):
        self.browser.open(self.bare)
        for state in ("kept", "undecided", "contradictory"):
            squares = self.browser.run(
                "return document.querySelector(`svg.matrix "
                "path.${arguments[0]}`).getAttribute('d').split('z').length;",
                state)
            number = self.database[f"num_{state}_pairs"]
            self.assertEqual(squares - 1, 2 * number)
        self.assertGreater(self.database["num_contradictory_pairs"], 0)

    def test_choice_of_a_square_shows_the_matches_of_the_pair(self):
        self.browser.open(self.bare)
        for state in ("kept", "contradictory"):
            pair = next(pair for pair in self.database["pairs"]
                        if pair["state"] == state)
            self.choose(pair)
            self.assertEqual(self.browser.texts("#pairs figcaption button"),
                             [pair["image1"], pair["image2"]])
            shown = min(pair["num_matches"], 30 if state == "kept" else 100)
            self.assertEqual(
                self.lines("kept") + self.lines("contradictory"), shown)
            if shown == pair["num_matches"]:
                self.assertEqual(self.lines("kept"), pair["num_agreeing"])

    def test_choice_of_a_row_shows_the_pair(self):
        self.browser.open(self.bare)
        rows = [pair for pair in self.database["pairs"]
                if pair["state"] == "contradictory"]
        rows.sort(key=lambda pair: -pair["num_matches"])
        self.browser.run(
            "document.querySelector('#pairs tbody tr').click();")
        self.assertEqual(self.browser.texts("#pairs figcaption button"),
                         [rows[0]["image1"], rows[0]["image2"]])

    def test_photos_are_shown_where_they_are_given(self):
        self.browser.open(self.page)
        for pair in self.database["pairs"]:
            self.choose(pair)
            num_photos = len(self.browser.run(
                "return [...document.querySelectorAll('svg.pair image')]"
                ".map(() => 1);"))
            names = (pair["image1"], pair["image2"])
            self.assertEqual(num_photos, 2 - (self.missing in names))


class ToleranceTest(PageTest):
    def test_boxes_are_listed_and_shown(self):
        self.synthesize(6, 30, "--Scene.pixel_noise", 0.3)
        report, page = self.run_with_page(
            "tolerance_analyzer", "--ToleranceAnalyzer.max_error", 3)
        boxes = report["boxes"]
        browser = self.browser
        browser.open(page)
        self.assertEqual(browser.texts("#boxes tbody td:first-child"),
                         [box["image_name"] for box in boxes])
        width = boxes[0]["high"]["proved"][0] - boxes[0]["low"]["proved"][0]
        self.assertAlmostEqual(
            float(browser.texts("#boxes tbody td:nth-child(2)")[0]), width,
            delta=1e-3 * width)
        self.assertIn("are proved", browser.text("#verdict"))
        browser.run("document.querySelector('#boxes tbody tr').click()")
        self.assertEqual(browser.texts(".info h3"), [boxes[0]["image_name"]])


def main():
    global BROWSER, KROT
    KROT = sys.argv.pop(1)
    program = Chromium.missing_program()
    if program is not None:
        print(f"skipped: there is no {program}")
        return SKIPPED
    with Chromium((1200, 1300)) as BROWSER:
        return 0 if unittest.main(exit=False).result.wasSuccessful() else 1


if __name__ == "__main__":
    sys.exit(main())
