"""The page by keyboard alone, on a phone, light and dark, and when cancelled."""

from browser import ENTER, TAB
import krot_page
from krot_page import KrotPage

_ARROW_LEFT = "\uE012"

# What can be used among some elements, and what has the focus.
_CONTROLS = """
const controls = [...document.querySelectorAll(arguments[0])].filter((control) =>
    control.matches('a[href], button, input, summary, iframe') &&
    control.getClientRects().length > 0 && !control.closest('[inert]'));
const name = (control) => control.id || control.name || control.textContent;
return [controls.map(name), name(document.activeElement)];
"""
# The lowest contrast of a text that can be seen with its ground (WCAG 2).
_CONTRAST = """
const numbers = (color) => color.match(/[\\d.]+/g).map(Number);
const luminance = (color) => numbers(color).slice(0, 3).map((byte) => {
  const share = byte / 255;
  return share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4;
}).reduce((sum, light, i) => sum + light * [0.2126, 0.7152, 0.0722][i], 0);
const groundOf = (element) => {
  const ground = getComputedStyle(element).backgroundColor;
  return numbers(ground)[3] === 0 && element.parentElement ?
      groundOf(element.parentElement) : ground;
};
const contrasts = [...document.querySelectorAll('body, body *')]
    .filter((element) => element.getClientRects().length > 0 &&
        [...element.childNodes].some(({ nodeType, data }) =>
            nodeType === Node.TEXT_NODE && data.trim()))
    .map((element) => {
      const [low, high] = [getComputedStyle(element).color, groundOf(element)]
          .map(luminance).sort((a, b) => a - b);
      return (high + 0.05) / (low + 0.05);
    });
return Math.min(...contrasts);
"""


class Keyboard(KrotPage):

    def assert_reaches_every_control(self, selector):
        missing = set(self.browser.run(_CONTROLS, selector)[0])
        self.assertTrue(missing)
        for _ in range(60):
            self.browser.press(TAB)
            missing.discard(self.browser.run(_CONTROLS, selector)[1])
            if not missing:
                return
        self.fail(f"Tab does not reach {missing}")

    def test_opens_the_choosers(self):
        self.browser.run("""
            window.opened = [];
            document.addEventListener('click', (event) => {
              event.preventDefault();
              opened.push(event.target.id);
            });""")
        for chooser in ("choose-folder", "choose-files"):
            self.tab_to("#" + chooser)
            self.browser.press(ENTER)
            self.browser.press(" ")
            self.assertEqual(self.browser.run("return opened.splice(0)"),
                             [chooser, chooser])

    def test_reaches_every_control(self):
        self.give(self.root / "scene")
        self.assert_reaches_every_control("#drop *, #tasks *")
        self.submit("#filter")
        self.assert_reaches_every_control("#result *")

    def test_solves_and_takes_the_result(self):
        self.give(self.root / "scene")
        self.tab_to("#solve button")
        self.browser.press(ENTER)
        self.assertRegex(self.wait_for_result(), "^The largest error fell")
        self.assertTrue(self.browser.run(
            "return document.activeElement.matches('#solve button')"))
        self.tab_to("#downloads a")
        self.browser.press(ENTER)
        self.wait_for_download("result.zip")

    def test_opens_what_the_command_line_prints(self):
        self.give(self.root / "scene")
        self.submit("#solve")
        self.tab_to("summary")
        self.browser.press(" ")
        self.assertTrue(self.browser.run(
            "return document.querySelector('details').open"))

    def test_takes_another_bound(self):
        self.give(self.root / "scene")
        self.tab_to("#filter button")
        self.browser.press(" ")
        self.wait_for_result()
        self.tab_to("#level")
        before = self.browser.text("#bound")
        self.browser.press(_ARROW_LEFT)
        self.assertNotEqual(self.browser.text("#bound"), before)
        self.tab_to("#take")
        self.browser.press(" ")
        self.wait_for("document.querySelector('#result').hidden")
        self.assertRegex(self.wait_for_result(), r"^Without \d+ of")

    def test_cancels(self):
        self.give(krot_page.SAMPLE)
        self.tab_to("#solve button")
        self.browser.press(ENTER)
        self.wait_for("!document.querySelector('#run').hidden")
        self.tab_to("#cancel")
        self.browser.press(ENTER)
        self.wait_for("document.querySelector('#run').hidden")
        self.assertTrue(self.browser.run(
            "return document.querySelector('#result').hidden"))
        self.assertIn("The largest error", self.submit("#solve"))


class LightPhone(KrotPage):
    IS_DARK = False

    @classmethod
    def open_browser(cls):
        super().open_browser(size=(390, 844), touch=True, dark=cls.IS_DARK)

    def assert_can_be_read(self):
        width, scroll_width = self.browser.run(
            "return [innerWidth, document.documentElement.scrollWidth]")
        self.assertEqual(width, 390)
        self.assertLessEqual(scroll_width, width)
        self.assertGreaterEqual(self.browser.run(_CONTRAST), 4.5)

    def test_can_be_read_from_the_model_to_the_result(self):
        self.assertEqual(self.IS_DARK, self.browser.run(
            "return matchMedia('(prefers-color-scheme: dark)').matches"))
        self.assert_can_be_read()
        self.give(self.root / "scene")
        self.assert_can_be_read()
        self.submit("#filter")
        self.browser.run("document.querySelector('details').open = true")
        self.assert_can_be_read()

    def test_can_be_read_when_it_refuses(self):
        self.give(krot_page.KROT.parent / "CMakeCache.txt", "#choose-files")
        self.assert_can_be_read()


class DarkPhone(LightPhone):
    IS_DARK = True


class Silence(KrotPage):

    def test_would_not_go_unnoticed_if_it_were_broken(self):
        page = self.root / "loud.html"
        page.write_text("<img src='http://127.0.0.1:45454/picture.png'>"
                        "<script>console.error('loud')</script>")
        self.browser.open(page.as_uri())
        self.assertIn("http://127.0.0.1:45454/picture.png", self.foreign_requests())
        self.assertIn("loud", str(self.browser.console()))
