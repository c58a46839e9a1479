"""What a test asks of a headless browser; chromium.py and firefox.py drive one.

Actions of mouse and keyboard are those of
https://www.w3.org/TR/webdriver2/#actions
"""

import abc
import shutil

TAB, ENTER = "\uE004", "\uE007"


class Browser(abc.ABC):
    """A window; a context manager."""

    PROGRAMS = ()  # that a driver needs

    @classmethod
    def missing_program(cls):
        """The name of one that is not installed; None if all are."""
        return next((program for program in cls.PROGRAMS
                     if shutil.which(program) is None), None)

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.close()

    @abc.abstractmethod
    def close(self):
        """Ends the browser."""

    @abc.abstractmethod
    def open(self, url):
        """Returns when the page is loaded."""

    @abc.abstractmethod
    def run(self, script, *arguments):
        """The value of the body of an async function, of which `arguments` are
        the arguments."""

    @abc.abstractmethod
    def choose(self, selector, path):
        """Gives a file, or a folder, to an <input type=file>."""

    @abc.abstractmethod
    def drop(self, selector, path):
        """Drops a file, or a folder, on an element."""

    @abc.abstractmethod
    def console(self):
        """What the console said since the last call: (level, message)."""

    @abc.abstractmethod
    def requests(self):
        """The addresses that were asked for since the last call."""

    @abc.abstractmethod
    def screenshot(self):
        """What the window shows, as PNG bytes."""

    @abc.abstractmethod
    def _perform(self, source):
        """Performs the actions of one mouse or keyboard."""

    @abc.abstractmethod
    def _origin(self, selector):
        """The element in the middle of which a pointer's move begins."""

    def text(self, selector):
        return self.run(
            "return document.querySelector(arguments[0]).textContent", selector)

    def texts(self, selector):
        return self.run("return [...document.querySelectorAll(arguments[0])]"
                        ".map((element) => element.textContent)", selector)

    def click(self, selector, x=0, y=0):
        """A mouse click, (x, y) CSS pixels from the element's centre."""
        self._point([
            self._move(selector, x, y),
            {"type": "pointerDown", "button": 0},
            {"type": "pointerUp", "button": 0},
        ])

    def drag(self, selector, by):
        self._point([
            self._move(selector, 0, 0),
            {"type": "pointerDown", "button": 0},
            self._move(selector, by[0], by[1]),
            {"type": "pointerUp", "button": 0},
        ])

    def press(self, key):
        self._perform({"type": "key", "id": "keyboard", "actions": [
            {"type": "keyDown", "value": key},
            {"type": "keyUp", "value": key}]})

    def _move(self, selector, x, y):
        return {"type": "pointerMove", "duration": 0, "x": x, "y": y,
                "origin": self._origin(selector)}

    def _point(self, actions):
        self._perform({"type": "pointer", "id": "mouse", "actions": actions,
                       "parameters": {"pointerType": "mouse"}})
