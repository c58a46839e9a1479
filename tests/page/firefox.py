"""Drives a headless Firefox by its WebDriver, with the standard library only.

Protocol: https://www.w3.org/TR/webdriver-bidi/ (JSON over a WebSocket). There is
no WebGL without a graphics card.
"""

import base64
import json
import pathlib
import re
import subprocess
import tempfile

from browser import Browser
from websocket import WebSocket

_CONSOLE, _REQUEST = "log.entryAdded", "network.beforeRequestSent"
_DROP = """
const [selector, files] = arguments;
const transfer = new DataTransfer();
for (const [name, base64] of files) {
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  transfer.items.add(new File([bytes], name));
}
document.querySelector(selector).dispatchEvent(new DragEvent('drop', {
  dataTransfer: transfer, bubbles: true, cancelable: true }));
"""


def _files(path):
    return sorted(file for file in path.iterdir() if file.is_file()
                  ) if path.is_dir() else [path]


class Firefox(Browser):
    """One window of `size` (width, height) CSS pixels; what is downloaded goes
    to `downloads`. A folder is given as its files, without its name."""

    PROGRAMS = ("firefox-esr",)

    def __init__(self, size=(1200, 900), dark=False, scale=1, touch=False,
                 downloads=None):
        self._profile = tempfile.TemporaryDirectory(
            ignore_cleanup_errors=True)  # its last process writes for a moment
        preferences = {
            "browser.download.dir": str(downloads or self._profile.name),
            "browser.download.folderList": 2,
            "browser.download.alwaysOpenPanel": False,
            "layout.css.prefers-color-scheme.content-override":
                0 if dark else 1,
            "ui.prefersReducedMotion": 1,  # where it scrolls to, it is at once
            "dom.w3c_touch_events.enabled": int(touch),
        }
        pathlib.Path(self._profile.name, "user.js").write_text("".join(
            f"user_pref({json.dumps(name)}, {json.dumps(value)});\n"
            for name, value in preferences.items()))
        self._process = subprocess.Popen(
            ["firefox-esr", "--headless", "--no-remote", "--profile",
             self._profile.name, "--remote-debugging-port", "0"],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self._socket = WebSocket("127.0.0.1", self._wait_for_port(), "/session",
                                 timeout=120)
        self._number = 0  # of the last command
        self._events = {_CONSOLE: [], _REQUEST: []}
        self._command("session.new", capabilities={})
        self._command("session.subscribe", events=list(self._events))
        # The first tab is the browser's own, and does not give up the focus.
        self._window = self._command("browsingContext.create",
                                     type="tab")["context"]
        self._do("browsingContext.setViewport", devicePixelRatio=scale,
                 viewport={"width": size[0], "height": size[1]})

    def close(self):
        try:
            self._command("browser.close")
        finally:
            self._socket.close()
            self._process.terminate()
            self._process.wait()
            self._process.stderr.close()
            self._profile.cleanup()

    def _wait_for_port(self):
        for line in self._process.stderr:
            match = re.search(r"listening on ws://127\.0\.0\.1:(\d+)", line)
            if match:
                return int(match.group(1))
        raise RuntimeError("firefox-esr did not start")

    def _command(self, method, **parameters):
        self._number += 1
        self._socket.send(json.dumps({
            "id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.receive())
            if message["type"] == "event":
                self._events[message["method"]].append(message["params"])
            elif message["type"] == "error":
                raise RuntimeError(message["message"])
            elif message["id"] == self._number:
                return message["result"]

    def _do(self, method, **parameters):
        return self._command(method, context=self._window, **parameters)

    def open(self, url):
        self._do("browsingContext.navigate", url=url, wait="complete")

    def run(self, script, *arguments):
        # As JSON both ways: the protocol's own values are typed.
        answer = self._command(
            "script.callFunction", target={"context": self._window},
            awaitPromise=True, functionDeclaration="""async function (json) {
                const body = async function () {%s};
                return JSON.stringify(
                    (await body.apply(null, JSON.parse(json))) ?? null);
            }""" % script,
            arguments=[{"type": "string", "value": json.dumps(arguments)}])
        if answer["type"] == "exception":
            raise RuntimeError(answer["exceptionDetails"]["text"])
        return json.loads(answer["result"]["value"])

    def choose(self, selector, path):
        if path.is_dir():  # which the protocol has no word for
            self.run("document.querySelector(arguments[0]).multiple = true",
                     selector)
        self._do("input.setFiles", element=self._element(selector),
                 files=[str(file) for file in _files(path)])

    def drop(self, selector, path):
        self.run(_DROP, selector, [
            (file.name, base64.b64encode(file.read_bytes()).decode())
            for file in _files(path)])

    def _element(self, selector):
        found = self._do("browsingContext.locateNodes",
                         locator={"type": "css", "value": selector})
        return {"sharedId": found["nodes"][0]["sharedId"]}

    def _origin(self, selector):
        return {"type": "element", "element": self._element(selector)}

    def _perform(self, source):
        self._do("input.performActions", actions=[source])

    def _take(self, event):
        self._command("session.status")  # what comes before the answer is there
        taken, self._events[event] = self._events[event], []
        return taken

    def console(self):
        return [(entry["level"], entry["text"]) for entry in self._take(_CONSOLE)]

    def requests(self):
        return [entry["request"]["url"] for entry in self._take(_REQUEST)]

    def screenshot(self):
        return base64.b64decode(
            self._do("browsingContext.captureScreenshot")["data"])
