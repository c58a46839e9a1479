"""Drives a headless Chromium by its WebDriver, with the standard library only.

Protocol: https://www.w3.org/TR/webdriver2/ (JSON over HTTP).
"""

import base64
import json
import re
import shutil
import subprocess
import urllib.request

from browser import Browser

# Software WebGL, so that no graphics card is needed.
_ARGUMENTS = [
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage",
    "--hide-scrollbars", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--force-prefers-reduced-motion",  # where it scrolls to, it is at once
]
_ELEMENT = "element-6066-11e4-a52e-4f735466cecf"


class Chromium(Browser):
    """One window of `size` (width, height) CSS pixels; what is downloaded goes
    to `downloads`."""

    PROGRAMS = ("chromium", "chromedriver")

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

    def close(self):
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
        body = "return (async function () {%s}).apply(null, arguments)"
        return self._request("POST", "/execute/sync", {
            "script": body % script, "args": list(arguments)})

    def choose(self, selector, path):
        self._request("POST", "/element/%s/value" % self._element(selector),
                      {"text": str(path)})

    def drop(self, selector, path):
        x, y = self.run("""
            const box = document.querySelector(arguments[0])
                .getBoundingClientRect();
            return [box.x + box.width / 2, box.y + box.height / 2];""", selector)
        # https://chromedevtools.github.io/devtools-protocol/
        for kind in ("dragEnter", "dragOver", "drop"):
            self._request("POST", "/goog/cdp/execute", {
                "cmd": "Input.dispatchDragEvent", "params": {
                    "type": kind, "x": x, "y": y, "data": {
                        "items": [], "files": [str(path)],
                        "dragOperationsMask": 1}}})

    def _element(self, selector):
        return self._request("POST", "/element", {
            "using": "css selector", "value": selector})[_ELEMENT]

    def _origin(self, selector):
        return {_ELEMENT: self._element(selector)}

    def _perform(self, source):
        self._request("POST", "/actions", {"actions": [source]})

    def console(self):
        entries = self._request("POST", "/se/log", {"type": "browser"})
        return [(entry["level"], entry["message"]) for entry in entries]

    def requests(self):
        entries = self._request("POST", "/se/log", {"type": "performance"})
        events = [json.loads(entry["message"])["message"] for entry in entries]
        return [event["params"]["request"]["url"] for event in events
                if event["method"] == "Network.requestWillBeSent"]

    def screenshot(self):
        return base64.b64decode(self._request("GET", "/screenshot"))
