"""Random messages at a running controller, by UDP and TCP: valid, broken, repeated, out of order, in pieces.

As a tool: python -m tests.fmu.controller.exchange.fuzz 3600 [seed], for an hour.
"""

import contextlib
import socket
import sys
import threading
import time

import numpy as np

from gantrytau_fmu.controller import AxisLimits, Channel, Controller, Declaration, RemoteClient
from gantrytau_fmu.controller.exchange.messages import (
    HEADER,
    MAGIC,
    Introduction,
    Message,
    MessageKind,
    WrongMessage,
    as_text,
    decoded,
    encoded,
    framed,
)
from tests.fmu.controller.conftest import slide

LIMIT = 0.01  # m, of what clients may send
SPEED = 0.5  # m/s, of the axis
PLACES = ("udp", "tcp")


def fuzzed(seconds: float, seed: int) -> dict[str, float]:
    """Run a controller with a wall clock under fire for so many seconds; what became of it.

    Raises AssertionError where a value beyond limits was applied, a sample is missing, or a thread hangs.
    """
    places = [RemoteClient(name, Declaration([Channel("delta", "m", 1, -LIMIT, LIMIT)])) for name in PLACES]
    controller = Controller(
        slide(),
        lambda t, values: {"q_ref": values["udp.delta"] + values["tcp.delta"]},
        clients=places,
        clock="wall",
        limits={"q_ref": AxisLimits(-0.05, 0.05, SPEED)},
    )
    before = set(threading.enumerate())
    server, end = controller.serve(), threading.Event()
    guns = [
        threading.Thread(target=_fire, args=(name, server.port, np.random.default_rng([seed, k]), end))
        for k, name in enumerate(PLACES)
    ]
    for gun in guns:
        gun.start()
    found = controller.run(seconds)
    end.set()
    for gun in guns:
        gun.join(timeout=60.0)
    assert not any(gun.is_alive() for gun in guns), "a client hangs"
    left = set(threading.enumerate()) - before
    assert not any(thread.name == "exchange" for thread in left), "the server hangs"
    assert found.time.size == int(seconds / 0.004 + 1e-9) + 1, "samples are missing"
    applied = found["applied.q_ref"]
    assert np.isfinite(applied).all(), "a value that is not finite was applied"
    assert np.abs(applied).max() <= 2 * LIMIT + 1e-12, "a value beyond its limits was applied"
    assert np.abs(np.diff(applied)).max() <= SPEED * 0.004 + 1e-12, "a jump was applied"
    assert np.array_equal(found["f_activate"], np.zeros(found.time.size)), (
        "a parameter was set without the token"
    )
    counts = found.timing.clients
    return {
        "taken": sum(counts[name].taken for name in PLACES),
        "dropped": server.dropped + sum(counts[name].dropped for name in PLACES),
        "refused": server.refused,
    }


def _fire(name: str, port: int, random: np.random.Generator, end: threading.Event) -> None:
    """Fire at a port until the end; a connection that is closed is opened again."""
    said = Introduction(name, sends=Declaration([Channel("delta", "m", 1, -LIMIT, LIMIT)]))
    hello, kind = encoded(Message(MessageKind.DECLARE, text=as_text(said))), name
    while not end.is_set():
        with contextlib.suppress(OSError), _opened(kind, port) as own:
            own.send(hello if kind == "udp" else framed(hello))
            shot = 0
            for _ in range(int(random.integers(20, 2000))):
                if end.is_set():
                    return
                data = _shot(random, hello, shot)
                if kind == "tcp":
                    data = framed(data) if random.random() < 0.999 else data
                own.sendall(data)
                with contextlib.suppress(TimeoutError, WrongMessage, IndexError):
                    seen = decoded(own.recv(65_536)[0 if kind == "udp" else 4 :])
                    shot = seen.sequence if seen.kind == MessageKind.SUBMIT else shot
                time.sleep(random.choice([0.0, 0.0005, 0.004], p=[0.3, 0.4, 0.3]))


def _opened(kind: str, port: int) -> socket.socket:
    own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM if kind == "udp" else socket.SOCK_STREAM)
    own.settimeout(0.002)
    own.connect(("127.0.0.1", port))
    return own


def _shot(random: np.random.Generator, hello: bytes, shot: int) -> bytes:
    """One message, or what looks like one."""
    values = random.choice(
        [0.0, 0.005, -0.01, 0.02, 1e300, np.nan, np.inf], size=random.choice([1, 1, 1, 0, 2, 9])
    )
    kind = MessageKind(
        int(random.choice([2, 2, 2, 2, 3, 1, 4, 6], p=[0.3, 0.2, 0.2, 0.1, 0.1, 0.05, 0.045, 0.005]))
    )
    sequence = int(
        random.choice([shot, shot, shot + 3, max(shot - 5, 0), 2**32 - 1], p=[0.5, 0.3, 0.1, 0.099, 0.001])
    )
    if kind in (MessageKind.BYE,):
        whole = encoded(Message(kind, text="x"))
    else:
        whole = HEADER.pack(MAGIC, kind, values.size, sequence, shot * 4_000_000) + values.tobytes()
    way = random.random()
    if way < 0.6:
        return whole
    if way < 0.65:
        return hello
    if way < 0.7:
        return random.bytes(int(random.integers(0, 400)))
    broken = bytearray(whole if random.random() < 0.7 else hello)
    for _ in range(int(random.integers(1, 5))):
        broken[int(random.integers(len(broken)))] = int(random.integers(256))
    return bytes(broken[: int(random.integers(1, len(broken) + 1))])


if __name__ == "__main__":
    left, seed = float(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    while left > 0:
        print(f"seed {seed}:", fuzzed(min(left, 60.0), seed), flush=True)
        left, seed = left - 60.0, seed + 1
