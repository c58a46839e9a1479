"""A picture of krot.html after a solve.

Usage: browser_screenshot.py KROT_HTML MODEL PICTURE.png
"""

import pathlib
import sys
import time

from chromium import Chromium


def wait_for(browser, element):
    while browser.run("return document.querySelector(arguments[0]).hidden",
                      element):
        time.sleep(0.2)


def main():
    page, model, picture = (pathlib.Path(path).resolve()
                            for path in sys.argv[1:4])
    with Chromium((1240, 1400)) as browser:
        browser.open(page.as_uri())
        browser.choose("#choose-folder", model)
        wait_for(browser, "#tasks")
        browser.run("document.querySelector('#solve').requestSubmit()")
        wait_for(browser, "#result")
        time.sleep(2)  # the report draws
        picture.write_bytes(browser.screenshot())


if __name__ == "__main__":
    main()
