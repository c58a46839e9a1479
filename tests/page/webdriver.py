"""Drives a headless Chromium by its WebDriver, with the standard library only.

Protocol: https://www.w3.org/TR/webdriver2/ (JSON over HTTP).
"""

import base64
import json
import re
import shutil
import subprocess
import urllib.request

# Software WebGL, so that no graphics card is needed.
_ARGUMENTS = [
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage",
    "--hide-scrollbars", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
_ELEMENT = "element-6066-11e4-a52e-4f735466cecf"


def missing_program():
    """The name of a program that is needed and not there; None if all are."""
    for program in ("chromium", "chromedriver"):
        if shutil.which(program) is None:
            return program
    return None


class Browser:
    """One window of `size` (width, height) CSS pixels; what is downloaded goes
    to `downloads`. A context manager."""

    def __init__(self, size=(1200, 900), dark=False, scale=1, touch=False,
                 downloads=None):
        arguments = _ARGUMENTS + [f"--force-device-scale-factor={scale}",
                                  "--window-size=%d,%d" % size]
        options = {"args": arguments, "binary": shutil.which("chromium")}
        if downloads:
            options["prefs"] = {
                "download.default_directory": str(downloads),
                "profile.default_content_setting_values.automatic_downloads":
                    1,  # several, without asking
            }
        if dark:
            arguments.append("--force-dark-mode")
        if touch:
            options["mobileEmulation"] = {"deviceMetrics": {
                "width": size[0], "height": size[1], "pixelRatio": scale}}
        self._driver = subprocess.Popen(
            ["chromedriver", "--port=0"], stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True)
        self._url = "http://127.0.0.1:%s" % self._wait_for_port()
        value = self._request("POST", "/session", {"capabilities": {
            "alwaysMatch": {"goog:chromeOptions": options,
                            "goog:loggingPrefs": {"browser": "ALL",
                                                  "performance": "ALL"}}}})
        self._url += "/session/" + value["sessionId"]

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        try:
            self._request("DELETE", "")
        finally:
            self._driver.terminate()
            self._driver.wait()

    def _wait_for_port(self):
        for line in self._driver.stdout:
            match = re.search(r"started successfully on port (\d+)", line)
            if match:
                return match.group(1)
        raise RuntimeError("chromedriver did not start")

    def _request(self, method, path, body=None):
        request = urllib.request.Request(
            self._url + path, method=method,
            data=None if body is None else json.dumps(body).encode(),
            headers={"Content-Type": "application/json"})
        try:
            with urllib.request.urlopen(request, timeout=120) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(json.load(error)["value"]["message"]) from None

    def open(self, url):
        self._request("POST", "/url", {"url": url})

    def run(self, script, *arguments):
        """The value of the body of an async function, of which `arguments` are
        the arguments."""
        body = "return (async function () {%s}).apply(null, arguments)"
        return self._request("POST", "/execute/sync", {
            "script": body % script, "args": list(arguments)})

    def text(self, selector):
        return self.run(
            "return document.querySelector(arguments[0]).textContent", selector)

    def texts(self, selector):
        return self.run("return [...document.querySelectorAll(arguments[0])]"
                        ".map((element) => element.textContent)", selector)

    def click(self, selector, x=0, y=0):
        """A mouse click, (x, y) CSS pixels from the element's centre."""
        self._pointer([
            self._move(selector, x, y),
            {"type": "pointerDown", "button": 0},
            {"type": "pointerUp", "button": 0},
        ])

    def drag(self, selector, by):
        self._pointer([
            self._move(selector, 0, 0),
            {"type": "pointerDown", "button": 0},
            self._move(selector, by[0], by[1]),
            {"type": "pointerUp", "button": 0},
        ])

    def choose(self, selector, path):
        """Gives a file, or a folder, to an <input type=file>."""
        self._request("POST", "/element/%s/value" % self._element(selector),
                      {"text": str(path)})

    def _element(self, selector):
        return self._request("POST", "/element", {
            "using": "css selector", "value": selector})[_ELEMENT]

    def _move(self, selector, x, y):
        return {"type": "pointerMove", "duration": 0, "x": x, "y": y,
                "origin": {_ELEMENT: self._element(selector)}}

    def _pointer(self, actions):
        self._request("POST", "/actions", {"actions": [{
            "type": "pointer", "id": "mouse",
            "parameters": {"pointerType": "mouse"}, "actions": actions}]})

    def console(self):
        """What the console said since the last call: (level, message)."""
        entries = self._request("POST", "/se/log", {"type": "browser"})
        return [(entry["level"], entry["message"]) for entry in entries]

    def requests(self):
        """The addresses that were asked for since the last call."""
        entries = self._request("POST", "/se/log", {"type": "performance"})
        events = [json.loads(entry["message"])["message"] for entry in entries]
        return [event["params"]["request"]["url"] for event in events
                if event["method"] == "Network.requestWillBeSent"]

    def screenshot(self):
        """What the window shows, as PNG bytes."""
        return base64.b64decode(self._request("GET", "/screenshot"))
