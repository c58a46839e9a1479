"""What the page computes is what the command line does."""

import json
import math

import krot_page
from krot_page import KrotPage, krot, zipped


class Computing(KrotPage):

    def test_tells_what_the_model_is(self):
        self.give(krot_page.SAMPLE)
        self.assertIn("24 images, 6,718 points, 30,978 observations; largest "
                      "error 3.7419 px", self.browser.text("#model"))

    def test_solves_the_sample_as_the_command_line_does(self):
        self.give(krot_page.SAMPLE)
        sentence = self.submit("#solve")
        self.assertRegex(sentence, r"^The largest error fell from 3\.74 px to "
                         r"3\.21 px\. .*, proved .* below 3\.20\d\d px\.")
        model = self.unpack(self.download("result.zip"))
        self.assertEqual({file.name for file in model.iterdir()},
                         {file.name for file in krot_page.SAMPLE.glob("*.bin")})
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

    def test_solves_a_model_without_errors(self):
        scene = self.root / "exact"
        krot("model_synthesizer", "--output_path", scene,
             "--Scene.num_frames", 6, "--Scene.num_points", 60)
        self.give(scene)
        self.assertRegex(self.submit("#solve"),
                         "^(Every error is zero up to rounding|The largest "
                         "error stayed at 0.00 px)")
        self.assertFalse(self.is_wrong("#sentence"))

    def test_reads_a_zip_and_writes_text_for_text(self):
        self.give(zipped(self.root / "scene", self.root / "scene.zip"),
                  "#choose-files")
        self.assertIn("8 images", self.browser.text("#model"))
        self.submit("#solve")
        model = self.unpack(self.download("result.zip"))
        self.assertTrue((model / "images.txt").exists())
        largest = []
        for folder in (self.root / "native", model):
            file = self.root / "analysed.json"
            krot("model_analyzer", "--path", folder, "--report_path", file)
            largest.append(json.loads(file.read_text())["pixel_error"]["max"])
        self.assertAlmostEqual(largest[0], largest[1], delta=2e-3 * largest[0])

    def test_solves_dropped_rigs(self):
        scene = self.root / "rigs"
        krot("model_synthesizer", "--output_path", scene, "--output_type", "TXT",
             "--Scene.num_frames", 6, "--Scene.num_points", 100,
             "--Scene.pixel_noise", 1, "--Scene.has_rigs", 1,
             "--Scene.sensors_per_rig", 2)
        self.browser.drop("#drop", scene)
        self.wait_until_read()
        self.assertIn("12 images, 100 points", self.browser.text("#model"))
        self.submit("#solve")
        model = self.unpack(self.download("result.zip"))
        self.assertEqual((model / "rigs.txt").read_bytes(),
                         (scene / "rigs.txt").read_bytes())
        code, _, _ = krot("certificate_checker", "--input_path", scene,
                          "--certificate_path",
                          self.download("certificate.json"))
        self.assertEqual(code, 0)

    def test_says_what_is_wrong_as_the_command_line_does(self):
        self.give(self.root / "scene")
        sentence = self.submit("#judge")
        krot("model_checker", "--input_path", self.root / "scene",
             "--output_path", self.root / "cured", "--report_path",
             self.root / "cured.json")
        report = json.loads((self.root / "cured.json").read_text())
        self.assertEqual(sentence, report["verdict"])
        self.assertEqual(
            (self.unpack(self.download("result.zip")) / "images.txt")
            .read_text(), (self.root / "cured" / "images.txt").read_text())

    def test_finds_wrong_observations_and_offers_every_bound(self):
        self.give(self.root / "scene")
        sentence = self.submit("#filter")
        self.assertRegex(sentence, r"^Without \d+ of [\d,]+ observations all others "
                         r"are within .* at least \d+ must go \(proved\)\.$")
        self.browser.run("""
            const slider = document.querySelector('#level');
            slider.value = 1;
            slider.dispatchEvent(new Event('input'));
            document.querySelector('#take').click();""")
        self.wait_for("document.querySelector('#result').hidden")
        self.assertRegex(self.wait_for_result(), r"^Without \d+ of")
        code, _, _ = krot("certificate_checker", "--input_path",
                          self.root / "scene", "--certificate_path",
                          self.download("conflicts.json"))
        self.assertEqual(code, 0)

    def test_judges_proofs_as_the_command_line_does(self):
        self.give(self.root / "scene")
        native = self.root / "native.json"
        wrong, broken = self.root / "wrong.json", self.root / "broken.json"
        bound = str(json.loads(native.read_text())["lower_bound"])
        wrong.write_text(native.read_text().replace(
            bound, str(1.5 * float(bound))))
        broken.write_text("{")
        for file in (native, wrong, broken):
            self.browser.choose("#check input", file)
            sentence = self.submit("#check")
            code, _, last = krot("certificate_checker", "--input_path",
                                 self.root / "scene", "--certificate_path",
                                 file)
            if code == 0:
                proved = math.floor(float(bound) * 1e4) / 1e4
                self.assertIn(f"at least {proved:.4f} px", sentence)
            else:
                self.assertEqual(sentence, last.replace(
                    str(file), "proof/certificate.json"))
            self.assertEqual(self.is_wrong("#sentence"), code != 0)

    def test_compares_two_models(self):
        self.give(self.root / "native")
        self.browser.choose("#compare input", zipped(
            self.root / "scene", self.root / "scene.zip"))
        self.assertRegex(self.submit("#compare"),
                         r"^The largest error of model 1 is [\d.]+ px, of model "
                         r"2 [\d.]+ px\.$")
        self.assertIn("True reprojection errors, pixels",
                      self.browser.text("#table"))
