"""The panel as a page in a browser of this machine: values to look at; what is set needs the token."""

import contextlib
import hmac
import json
import re
import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.panel.panel_link import PanelLink

PAGE = Path(__file__).with_name("panel.html")
LARGEST = 4096  # bytes of a request
HOST = re.compile(
    r"(127\.0\.0\.1|localhost|\[::1\])(:\d+)?"
)  # a page elsewhere that points here is not answered


class WebPanel:
    """Serves the panel of a controller at `url`; port 0 takes a free one. Only this machine can reach it.

    Raises ModelError for a port in use.
    """

    def __init__(self, link: PanelLink, *, port: int = 0):
        self.link = link
        try:
            self._server = ThreadingHTTPServer(
                ("127.0.0.1", port), type("Handler", (PanelHandler,), {"link": link})
            )
        except (OSError, OverflowError) as error:
            raise ModelError(
                f"panel: 127.0.0.1:{port} cannot be opened ({error}), expected a free port; take another one, or 0 for any",
                argument="port",
            ) from None
        self._server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}/"
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.1,), name="page", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Take the page down; the link stays."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(timeout=2.0)

    def __enter__(self) -> "WebPanel":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def snapshot(link: PanelLink) -> dict[str, Any]:
    """What the page shows."""
    parameters = {
        c.name: [c.unit, c.minimum, c.maximum, c.size] for c in link.parameters if c.name != "state"
    }
    return {
        "place": link.place,
        "k": link.k,
        "time": link.time,
        "state": link.state,
        "live": link.live,
        "ended": link.ended,
        "writable": bool(link.token),
        "values": link.values,
        "units": {c.name: c.unit for c in link.published},
        "parameters": parameters,
    }


class PanelHandler(BaseHTTPRequestHandler):
    """Answers the page; link: of the panel that serves it."""

    link: PanelLink
    timeout = 10.0

    def do_GET(self) -> None:
        """The page, and its values."""
        if not self._here():
            return
        if self.path == "/":
            self._answer(HTTPStatus.OK, PAGE.read_bytes(), "text/html; charset=utf-8")
        elif self.path == "/values":
            self._json(HTTPStatus.OK, snapshot(self.link))
        else:
            self._json(HTTPStatus.NOT_FOUND, {"error": f"there is no {self.path[:80]}"})

    def do_POST(self) -> None:
        """What the operator sets, with the token."""
        if not self._here():
            return
        given = self.headers.get("X-Token", "")
        if not self.link.token or not hmac.compare_digest(given.encode(), self.link.token.encode()):
            self._json(HTTPStatus.FORBIDDEN, {"error": "this needs the token of the controller"})
            return
        try:
            length = int(self.headers.get("Content-Length", ""))
            if self.path != "/set" or not 0 <= length <= LARGEST:
                raise ValueError
            asked = json.loads(self.rfile.read(length))
            if asked["name"] == "state":
                self.link.switch(str(asked["value"]))
            else:
                self.link.set(str(asked["name"]), [float(value) for value in asked["value"]])
        except ModelError as error:
            self._json(HTTPStatus.BAD_REQUEST, {"error": str(error)})
        except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
            self._json(HTTPStatus.BAD_REQUEST, {"error": "expected a name and its values, as JSON"})
        else:
            self._json(HTTPStatus.OK, {})

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: values are asked for many times a second."""

    def _here(self) -> bool:
        """Whether the request names this machine; the browser may have been led here by a page elsewhere."""
        if HOST.fullmatch(self.headers.get("Host", "")):
            return True
        self._json(HTTPStatus.FORBIDDEN, {"error": "this page answers to 127.0.0.1 only"})
        return False

    def _json(self, status: HTTPStatus, told: dict[str, Any]) -> None:
        self._answer(status, json.dumps(told).encode(), "application/json")

    def _answer(self, status: HTTPStatus, body: bytes, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        policy = (
            "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src 'self'"
        )
        self.send_header("Content-Security-Policy", f"{policy}; frame-ancestors 'none'")
        with contextlib.suppress(ConnectionError):  # the browser has left
            self.end_headers()
            self.wfile.write(body)
