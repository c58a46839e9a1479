"""Pictures of a report page; see screenshots.sh.

Usage: screenshots.py PAGE.html FILTERED.html SUSPECTS.html FOLDER
"""

import pathlib
import sys
import time

from chromium import Chromium


def show_worst(browser):
    """Colours by error, and the numbers of the worst camera and point."""
    browser.run("document.querySelector('input[value=error]').click()")
    browser.click("#support tbody tr:first-child td:first-child")
    time.sleep(2)  # the page scrolls there smoothly


def main():
    page = pathlib.Path(sys.argv[1]).resolve().as_uri()
    filtered = pathlib.Path(sys.argv[2]).resolve().as_uri()
    suspects = pathlib.Path(sys.argv[3]).resolve().as_uri()
    folder = pathlib.Path(sys.argv[4])
    # The height includes what a window has around the page.
    with Chromium((1100, 1180)) as browser:
        browser.open(page)
        (folder / "page_desk.png").write_bytes(browser.screenshot())
    with Chromium((1000, 760)) as browser:
        browser.open(filtered)
        browser.run(
            "document.getElementById('profile-section').scrollIntoView()")
        time.sleep(1)
        (folder / "page_profile.png").write_bytes(browser.screenshot())
    with Chromium((1000, 760)) as browser:
        browser.open(suspects)
        browser.run("document.getElementById('suspects').scrollIntoView()")
        time.sleep(1)
        (folder / "page_suspects.png").write_bytes(browser.screenshot())
    with Chromium((400, 860), dark=True, touch=True) as browser:
        browser.open(page)
        show_worst(browser)
        (folder / "page_phone.png").write_bytes(browser.screenshot())


if __name__ == "__main__":
    main()
