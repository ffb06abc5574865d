"""A solver at work on a thread of its own, so that the end of time and Ctrl-C need not wait for its iteration to end.

Between two of its iterations Ipopt may factor a matrix again and again, each time with more pivots put off, and asks nobody
meanwhile. What is wanted of it by then is the last iterate, which its callback has left here. The thread cannot be ended
from outside: it is left alone, and ends with its iteration; until then it takes a processor, and keeps MUMPS for itself.
"""

import atexit
import queue
import threading
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.interruption import on_interrupt
from gantrytau_optimica.solving.clock import Clock

GRACE = 1.0  # s, that an iteration may still take once it should end
PARTING = 5.0  # s, that a process waits at its end for threads that were left: one that meets a dying Python aborts it
LOOK = 0.1  # s, between looks at the clock: on Windows a wait is not ended by Ctrl-C


class Watch(ca.Callback):
    """Called by Ipopt after every iteration: reports progress, and stops when Ctrl-C was pressed or time is over.

    last: what Ipopt gave it, by the names of nlpsol's results. error: what the one who is told raised.
    """

    def __init__(self, unknowns: int, constraints: int):
        ca.Callback.__init__(self)
        self.sizes = {
            "x": unknowns,
            "f": 1,
            "g": constraints,
            "lam_x": unknowns,
            "lam_g": constraints,
            "lam_p": 0,
        }
        self.begin(None)
        self.construct("watch", {})

    def begin(self, clock: Clock | None) -> None:
        """Before a solve; without a clock nobody is told, and it takes the time that it takes."""
        self.clock = clock
        self.pressed = self.left = False
        self.error: BaseException | None = None
        self.iteration = 0
        self.last: dict[str, np.ndarray] = {}
        self.told: queue.SimpleQueue[tuple[int, float] | None] = queue.SimpleQueue()
        self.heard: queue.SimpleQueue[None] = queue.SimpleQueue()

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        size = self.sizes.get(ca.nlpsol_out(i), 0)
        return ca.Sparsity.dense(size, 1) if size else ca.Sparsity(0, 1 if i else 0)

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, arg: Any, res: Any) -> int:
        self.iteration += 1
        self.last = {
            ca.nlpsol_out(i): np.zeros(0) if one is None else np.frombuffer(one).copy()
            for i, one in enumerate(arg)
        }
        if self.clock is not None and self.clock.progress is None:
            self.clock.tell(self.iteration, float(self.last["f"].item()))
        elif self.clock is not None and not self.left:
            self.told.put((self.iteration, self.last["f"].item()))
            self.heard.get()
        late = self.clock is not None and not self.clock.left
        np.frombuffer(res[0])[:] = float(self.pressed or late or self.left or self.error is not None)
        return 0

    def tell(self, iteration: int, objective: float) -> None:
        """Report an iteration, on the thread of the caller: what is shown is seldom made to be called from others."""
        try:
            if self.clock is not None:
                self.clock.tell(iteration, objective)
        except KeyboardInterrupt:
            self.pressed = True
        except BaseException as error:  # raised again once Ipopt has let go
            self.error = error
        self.heard.put(None)

    def ask_to_stop(self) -> None:
        """Let Ipopt finish its iteration and keep what it has."""
        self.pressed = True

    def leave(self) -> None:
        """Nobody waits any more: what Ipopt does ends with its iteration."""
        self.left = True
        self.heard.put(None)


def attended(solver: ca.Function, watch: Watch, arguments: Mapping[str, Any]) -> dict[str, ca.DM] | None:
    """What a solver gives that reports to `watch`; None where an iteration took longer than GRACE after it should have
    ended: its thread is left then, and neither `solver` nor `watch` may be used again.
    """
    found: list[dict[str, ca.DM] | BaseException] = []

    def work() -> None:
        try:
            found.append(solver(**arguments))
        except BaseException as error:  # raised again on the thread of the caller
            found.append(error)
        watch.told.put(None)

    thread = threading.Thread(target=work, name="optimum", daemon=True)
    with on_interrupt(watch.ask_to_stop):
        thread.start()
        asked: float | None = None
        clock = Clock(np.inf)
        while True:
            try:
                told = watch.told.get(timeout=LOOK)
            except queue.Empty:
                over = watch.clock is not None and not watch.clock.left
                if asked is None and (watch.pressed or over or watch.error is not None):
                    asked = clock.passed
                if asked is not None and clock.passed > asked + GRACE:
                    watch.leave()
                    atexit.register(thread.join, PARTING)
                    return None
                continue
            if told is None:
                break
            watch.tell(*told)
    thread.join()
    (answer,) = found
    if isinstance(answer, BaseException):
        raise answer
    return answer
