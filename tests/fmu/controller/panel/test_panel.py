"""The operator panel: what it shows is what the controller publishes, what it sets needs the token."""

import io
import json
import threading
import urllib.error
import urllib.request

import pytest
from rich.console import Console

from gantrytau import ModelError
from gantrytau_fmu.controller import Channel, ControlledResult, Controller
from gantrytau_fmu.controller.panel import PanelLink, WebPanel, terminal_panel
from gantrytau_fmu.controller.panel.terminal_panel import obey, panel_table
from tests.fmu.controller.conftest import slide
from tests.fmu.controller.exchange.test_over_the_network import until


class Served:
    """A controller with a wall clock that runs in a thread and serves."""

    def __init__(self, stop=600.0):
        gain = Channel("gain", "1", minimum=0.0, maximum=2.0)
        pair = Channel("pair", "m", 2)
        self.controller = Controller(
            slide(),
            lambda t, values: {"q_ref": values["gain"]},
            clock="wall",
            parameters={gain: 0.5, pair: [0.0, 0.0], Channel("force[/b]", "N"): 0.0},
        )
        self.server = self.controller.serve()
        self.thread = threading.Thread(target=self._run, args=(stop,))
        self.found: ControlledResult | None = None

    def _run(self, stop):
        self.found = self.controller.run(stop)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.controller._press()
        self.thread.join(timeout=60.0)

    def link(self, token=True):
        return PanelLink(
            ("127.0.0.1", self.server.port), token=self.server.token if token else "", patience=60.0
        )


def test_values_come_and_parameters_go():
    with Served() as served, served.link() as link:
        until(lambda: link.k > 0 and link.live)
        assert link.state == "obtain"
        link.set("gain", [1.5])
        link.set("pair", [0.25, -0.5])
        until(lambda: link.values["gain"] == [1.5] and link.values["pair"] == [0.25, -0.5])
        until(lambda: abs(link.values["q"][0] - 1.5) < 1e-3)
        link.switch("idle")  # nothing is sent any more
        until(lambda: not link.live)
        link.switch("submit")
        until(lambda: link.live and link.state == "submit")
    assert served.found is not None
    assert served.found.ended == "interrupted"


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("gein", [1.0], r"there is no parameter 'gein'; did you mean 'gain'\?"),
        ("gain", [3.0], r"found gain = 3 1, expected a number in \[0, 2\]"),
        ("gain", [], "gain: found"),
        ("gain", [1.0, 2.0], r"gain: found \[1.0, 2.0\], expected one number"),
        ("pair", [1.0], "pair: found"),
        ("gain", [float("nan")], "found gain = nan"),
    ],
)
def test_what_cannot_be_set_is_told_before_it_is_sent(name, values, words):
    with Served() as served, served.link() as link, pytest.raises(ModelError, match=words):
        link.set(name, values)


def test_without_the_token_one_may_only_look():
    with Served() as served, served.link(token=False) as link:
        until(lambda: link.k > 0)
        with pytest.raises(ModelError, match="found no token, expected that of the controller"):
            link.set("gain", [1.0])
        with pytest.raises(ModelError, match="the token is not that of this controller"):
            PanelLink(("127.0.0.1", served.server.port), token="guessed")


def test_nobody_there_is_told():
    with pytest.raises(ModelError, match=r"found nobody who answers at 127\.0\.0\.1:9 within 0\.3 s.*--port"):
        PanelLink(("127.0.0.1", 9), patience=0.3)


def asked(url, *, token=None, told=None, host=None):
    headers = {} if token is None else {"X-Token": token}
    if host:
        headers["Host"] = host
    body = None if told is None else (told if isinstance(told, bytes) else json.dumps(told).encode())
    try:
        with urllib.request.urlopen(
            urllib.request.Request(url, data=body, headers=headers), timeout=60
        ) as found:
            return found.status, found.read(), found.headers
    except urllib.error.HTTPError as error:
        return error.code, error.read(), error.headers


def test_the_page_shows_values_and_sets_with_the_token():
    with Served() as served, served.link() as link, WebPanel(link) as page:
        until(lambda: link.k > 0)
        status, text, headers = asked(page.url)
        assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
        assert b"http" not in text.replace(b"http-equiv", b"")  # nothing from elsewhere
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        seen = json.loads(asked(page.url + "values")[1])
        assert seen["state"] == "obtain"
        assert seen["writable"]
        assert seen["parameters"]["gain"] == ["1", 0.0, 2.0, 1]
        token = served.server.token
        assert asked(page.url + "set", token=token, told={"name": "gain", "value": [1.25]})[0] == 200
        until(lambda: link.values["gain"] == [1.25])
        assert asked(page.url + "set", token=token, told={"name": "state", "value": "submit"})[0] == 200
        until(lambda: link.state == "submit")


def test_the_page_refuses_whoever_is_not_the_operator():
    with Served() as served, served.link() as link, WebPanel(link) as page:
        token = served.server.token
        good = {"name": "gain", "value": [1.0]}
        assert asked(page.url + "set", told=good)[0] == 403
        assert asked(page.url + "set", token="guessed", told=good)[0] == 403
        assert asked(page.url + "values", host="evil.example:80")[0] == 403
        assert asked(page.url + "set", token=token, told=good, host="evil.example:80")[0] == 403
        assert asked(page.url + "etc/passwd")[0] == 404
        assert asked(page.url + "set", token=token, told=b"no json")[0] == 400
        assert asked(page.url + "set", token=token, told=b"x" * 5000)[0] == 400
        huge = b'{"name": "gain", "value": [1' + b"0" * 400 + b"]}"
        assert asked(page.url + "set", token=token, told=huge)[0] == 400
        assert asked(page.url + "values", host="127.0.0.1")[0] == 200  # as browsers name port 80
        assert asked(page.url + "values", host="127.0.0.1.evil.example")[0] == 403
        status, text, _ = asked(page.url + "set", token=token, told={"name": "gain", "value": [9.0]})
        assert status == 400
        assert b"expected a number in [0, 2]" in text
        assert link.values.get("gain", [0.5]) == [0.5]
        with pytest.raises(ModelError, match="cannot be opened"):
            WebPanel(link, port=int(page.url.rsplit(":", 1)[1].strip("/")))


def test_the_terminal_shows_and_obeys():
    with Served() as served, served.link() as link:
        until(lambda: link.k > 0)
        screen, shown = io.StringIO(), []
        console = Console(file=screen, width=200, force_terminal=True, color_system=None)

        def lines():
            words = ("0.75", "'much'", "'[/x]'", "force[/b]")  # a name is no markup
            try:
                for line, word in zip(
                    ("set gain 0.75", "set gain much", "set [/x] 1", ""), words, strict=True
                ):
                    yield f"{line}\n"
                    until(lambda word=word: word in screen.getvalue())
                    shown.append(word)
            finally:
                yield "quit\n"

        terminal_panel(link, console, lines())
        assert len(shown) == 4
        assert "sample" in screen.getvalue()


def test_lines_that_say_nothing_are_told():
    with Served() as served, served.link() as link:
        for line in ("dance", "set gain", "idle now"):
            with pytest.raises(ModelError, match=r"expected idle \| submit \| obtain"):
                obey(link, line)
        for number in ("x", "0,5", "1e"):
            with pytest.raises(ModelError, match=f"found '{number}', expected numbers, as 1.5"):
                obey(link, f"set gain {number}")
        obey(link, "set pair 0.1, 0.2")
        until(lambda: link.values.get("pair") == [0.1, 0.2])
        assert not obey(link, "quit")
        assert panel_table(link).row_count == len(link.published.channels)
