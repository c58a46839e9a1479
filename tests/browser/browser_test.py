"""krot.html in a real browser: the tests beside this file.

Usage: browser_test.py chromium|firefox KROT KROT_HTML SAMPLE_MODEL [TEST...]
(exit code 77: that browser is not installed)
"""

import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "page"))
from chromium import Chromium  # noqa: E402
from firefox import Firefox  # noqa: E402
import krot_page  # noqa: E402

SKIPPED = 77

if __name__ == "__main__":
    browser = {"chromium": Chromium, "firefox": Firefox}[sys.argv[1]]
    program = browser.missing_program()
    if program:
        print("skipped: no " + program)
        sys.exit(SKIPPED)
    krot_page.OPEN_BROWSER = browser
    krot_page.KROT, krot_page.PAGE, krot_page.SAMPLE = (
        pathlib.Path(path).resolve() for path in sys.argv[2:5])
    # One browser is enough for all that the page computes and says.
    tests = sys.argv[5:] or {
        Chromium: ["computing_test", "using_test", "refusing_test"],
        Firefox: ["computing_test.Computing."
                  "test_solves_the_sample_as_the_command_line_does",
                  "using_test"]}[browser]
    unittest.main(module=None, argv=sys.argv[:1] + tests, verbosity=2)
