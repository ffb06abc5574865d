"""A browser without a window, led through its debugging port: what a page draws, says and fetches."""

import base64
import io
import json
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--no-first-run",
    "--disable-background-networking",
    "--window-size=800,600",
    "--remote-debugging-port=0",
)
PATIENCE = 60.0  # s, on a busy machine


def found() -> str | None:
    """The browser of this machine, if it has one."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Tab:
    """A page that is open. errors: what it complained of; fetched: addresses that it asked for."""

    def __init__(self, socket: Any):
        self._socket, self._number = socket, 0
        self.errors: list[str] = []
        self.fetched: list[str] = []
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._ask(f"{domain}.enable")

    def open(self, page: Path, document: str = "document", element: str = "canvas") -> None:
        """Go to a file, and wait until there is an element in a document of it: what it draws on."""
        for place in ("about:blank", page.resolve().as_uri()):  # page.html may follow page.html
            self._ask("Page.navigate", url=place)
            self.until(f"location.href === {json.dumps(place)}")
        self.until("document.readyState === 'complete'")
        self.until(f"{document}.querySelector('{element}') !== null")

    def run(self, script: str) -> Any:
        """The value of an expression in the page."""
        answer = self._ask("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def until(self, script: str) -> None:
        """Wait until an expression holds."""
        end = time.monotonic() + PATIENCE
        while not self.run(script):
            assert time.monotonic() < end, f"waited {PATIENCE:g} s for {script}"
            time.sleep(0.1)

    def press(self, x: float, y: float) -> None:
        """Press the left button of the mouse at a place of the window, in pixels."""
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            buttons = {} if kind == "mouseMoved" else {"button": "left", "clickCount": 1}
            self._ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **buttons)

    def drag(self, begin: float, end: float, y: float) -> None:
        """Move the mouse from one x to another with its left button pressed, in pixels."""
        button = {"button": "left", "clickCount": 1}
        for kind, x, more in (
            ("mouseMoved", begin, {}),
            ("mousePressed", begin, button),
            ("mouseMoved", (begin + end) / 2, {"buttons": 1}),
            ("mouseMoved", end, {"buttons": 1}),
            ("mouseReleased", end, button),
        ):
            self._ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)
            self.rest(0.05)

    def resize(self, width: int, height: int) -> None:
        """Make the window so large, in pixels."""
        size = dict(width=width, height=height, deviceScaleFactor=1, mobile=False)
        self._ask("Emulation.setDeviceMetricsOverride", **size)

    def quieten(self) -> None:
        """Close what it says of a machine without a graphics card."""
        button = "document.querySelector('.mantine-Notification-closeButton')"
        self.until(f"{button} !== null || performance.now() > 5000")
        self.run(f"{button}?.click()")
        self.rest(1.0)

    def pause(self) -> None:
        """Press the button that stops a motion."""
        self.run("document.querySelector('.mantine-ActionIcon-root').click()")

    def rest(self, seconds: float) -> None:
        """Let the page draw."""
        self.run(f"new Promise(done => setTimeout(done, {1e3 * seconds}))")

    def picture_at(self, share: float) -> np.ndarray:
        """What is seen where the slider is pressed at a share of its length."""
        box = self.run(
            "(() => {const r = document.querySelector('.mantine-Slider-track').getBoundingClientRect();"
            "return [r.left, r.top, r.width, r.height]})()"
        )
        self.press(box[0] + share * box[2], box[1] + box[3] / 2)
        self.rest(0.6)
        return self.picture()

    def picture(self) -> np.ndarray:
        """What is seen, (rows, columns, 3), 0 to 255."""
        data = base64.b64decode(self._ask("Page.captureScreenshot", format="png")["data"])
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=int)

    def _ask(self, method: str, **values: Any) -> dict[str, Any]:
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": values}))
        while True:
            message = json.loads(self._socket.recv(timeout=PATIENCE))
            if message.get("id") == self._number:
                assert "error" not in message, message
                return message["result"]
            self._hear(message.get("method", ""), message.get("params", {}))

    def _hear(self, method: str, said: dict[str, Any]) -> None:
        if method == "Runtime.exceptionThrown":
            self.errors.append(str(said["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and said["type"] in ("error", "assert"):
            self.errors.append(str(said["args"]))
        elif method == "Log.entryAdded" and said["entry"]["level"] == "error":
            self.errors.append(str(said["entry"]))
        elif method == "Network.requestWillBeSent":
            self.fetched.append(said["request"]["url"])


@contextmanager
def browsing(browser: str) -> Iterator[Tab]:
    """A tab of a browser that is started for it, and ended."""
    from websockets.sync.client import connect

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        port = Path(folder) / "DevToolsActivePort"
        process = subprocess.Popen(
            [browser, *FLAGS, f"--user-data-dir={folder}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            number = _number(port)
            with connect(_address(number), max_size=None, compression=None) as socket:
                yield Tab(socket)
        finally:
            process.terminate()
            process.wait(timeout=PATIENCE)


def _number(file: Path) -> int:
    """The port that the browser chose."""
    end = time.monotonic() + PATIENCE
    while not (file.is_file() and file.read_text().count("\n")):
        assert time.monotonic() < end, f"waited {PATIENCE:g} s for the browser"
        time.sleep(0.1)
    return int(file.read_text().split()[0])


def _address(port: int) -> str:
    """Where its first tab listens."""
    from urllib.request import urlopen

    end = time.monotonic() + PATIENCE
    while True:
        with urlopen(f"http://127.0.0.1:{port}/json/list", timeout=PATIENCE) as answer:
            tabs = [tab for tab in json.load(answer) if tab["type"] == "page"]
        if tabs:
            return tabs[0]["webSocketDebuggerUrl"]
        assert time.monotonic() < end, f"waited {PATIENCE:g} s for a tab"
        time.sleep(0.1)
