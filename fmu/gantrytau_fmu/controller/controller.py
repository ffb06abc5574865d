"""A robot controller that lets others overwrite its references from sample to sample, with a virtual or a wall clock.

In sample k, every `period`:
    1. what was set since takes effect: parameters, state
    2. measured y(k) -> sample k to all clients                       (states submit, obtain)
    3. answers of clients to sample k - 1, held where late              (state obtain)
    4. the user's controller, from all that is known in this sample      (its references act in state obtain)
    5. kinematics, limits -> plant, which goes on to sample k + 1
Blomdell et al. (2005) and chapter 3.2 of Dressler (2012) describe such an interface; messages are not those of theirs.
"""

import os
import time
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import check_words, number
from gantrytau.border.refusal import GantryTauError, ModelError, SolveError, did_you_mean
from gantrytau.interruption import on_interrupt
from gantrytau_fmu.controller.board import STATES, Board, State
from gantrytau_fmu.controller.channels import Channel, Declaration, Values
from gantrytau_fmu.controller.client_line import ClientLine
from gantrytau_fmu.controller.clients import Client, Sample
from gantrytau_fmu.controller.controller_checks import check_kinds, check_references, check_step
from gantrytau_fmu.controller.exchange.periodic_client import PeriodicClient
from gantrytau_fmu.controller.exchange.remote_client import RemoteClient
from gantrytau_fmu.controller.exchange.server import Server
from gantrytau_fmu.controller.external_kinematics import ExternalKinematics
from gantrytau_fmu.controller.laws.law import LawFunction
from gantrytau_fmu.controller.laws.periodic_law import PeriodicFunction, PeriodicLaw
from gantrytau_fmu.controller.laws.users_law import tunables_of, users_law
from gantrytau_fmu.controller.planned_changes import ROUNDING, PlannedChanges
from gantrytau_fmu.controller.reference_path import AxisLimits, ReferencePath
from gantrytau_fmu.controller.sample_clock import VirtualClock, WallClock
from gantrytau_fmu.controller.sample_log import SampleLog
from gantrytau_fmu.controller.stepped_part import SteppedPart
from gantrytau_fmu.controller.timing import ControlledResult, Timing
from gantrytau_fmu.systems.drives import Drive, drives_of
from gantrytau_fmu.systems.slave import RunEnded
from gantrytau_fmu.systems.sources.component_sources import Source


class Controller:
    """A plant under references that a user's controller and clients overwrite; it runs once.

    plant: model, FMU file or `PythonComponent`; its inputs take the references. controller: the same, or a function
    `law(t, values) -> {reference: value}`, or a shared library, see `laws/compiled_law.py`; None: the references as they
    are, or those of a law that `under` is given. clock: "virtual" waits for all clients, so that equal runs have equal logs,
    `patience` s at most; "wall" goes on every `period`, s.
    references: what the plant follows where nobody overwrites it: name -> number, vector, function of time, Samples or
    signal; by default the start values of the inputs. limits: `AxisLimits` by input. kinematics: poses are the references
    then. parameters: `Channel` -> value, tunable, beside those of the controller; `f_activate` from 0 to 1 is always there.
    wires: input or output of a controller that is a model -> name of what is known, or of a reference. starts: of the plant.
    state: "idle" sends nothing, "submit" sends samples, "obtain" takes references and answers too.
    Raises ModelError for what does not fit.
    """

    def __init__(
        self,
        plant: Source,
        controller: Source | LawFunction | None = None,
        *,
        period: float = 0.004,
        clock: Literal["virtual", "wall"] = "virtual",
        clients: Sequence[Client] = (),
        references: Mapping[str, Any] | None = None,
        limits: Mapping[str, AxisLimits] | None = None,
        kinematics: ExternalKinematics | None = None,
        parameters: Mapping[Channel, ArrayLike] | None = None,
        wires: Mapping[str, str] | None = None,
        starts: Mapping[str, Any] | None = None,
        state: State = "obtain",
        patience: float = 10.0,
    ):
        check_words(Controller, {"clock": clock, "state": state}, "controller")
        self.period = number("controller", "period", period, above=0.0, unit="s")
        patience = number("controller", "patience", patience, above=0.0, unit="s")
        self._clock = WallClock(self.period) if clock == "wall" else VirtualClock(self.period, patience)
        check_kinds(dict(limits=limits, references=references, parameters=parameters), kinematics, clients)
        self._plant = SteppedPart("plant", plant, starts)
        check_step(self._plant.component, self.period)
        self._path = ReferencePath(self._plant, limits or {}, kinematics, self.period)
        self._references = dict(references or {})
        check_references(self._path.declaration, self._references, kinematics)
        self._law, self._led = users_law(controller, wires or {}), controller is not None
        self.tunables, self._tuned = tunables_of(self._law, parameters or {})
        self._lines = list[ClientLine]()
        self._state: State = state
        self._coming: State = self._state
        self._changes = PlannedChanges(self.period)
        self._pressed, self._ran, self._wall = 0, False, 0.0
        self.k = -1
        for client in clients:
            self._lines.append(self._line(client))
        self._board = self._made_board()

    @property
    def state(self) -> State:
        """The state of the present sample."""
        return self._state

    @property
    def published(self) -> Declaration:
        """What clients are given: state, parameters, what is measured, nominal references."""
        return self._board.published

    @property
    def latest(self) -> dict[str, Any]:
        """All that is known in the present sample, by name."""
        return self._board.by_name()

    @property
    def timing(self) -> Timing:
        """How late samples were until now, and what became of answers."""
        lateness = np.array(self._clock.lateness)
        path = self._path
        return Timing(
            self._clock.name,
            self.period,
            self.k + 1,
            self._wall,
            lateness,
            int(np.sum(lateness >= self.period)),
            path.limited,
            path.refused,
            path.unreachable,
            {line.name: line.counts for line in self._lines},
        )

    def attach(self, client: Client) -> None:
        """One more client. ModelError once it runs, for what is no client, and for a name that another has."""
        if self._ran:
            raise ModelError(
                "controller: found a client that comes while it runs, expected it before; attach it first"
            )
        lines, self._lines = self._lines, [*self._lines, self._line(client)]
        try:
            self._board = self._made_board()
        except ModelError:
            self._lines = lines
            raise
        for line in self._lines:
            if isinstance(client, RemoteClient) and isinstance(line.client, Server):
                line.client.keep(client)

    def serve(self, port: int = 0, *, host: str = "127.0.0.1", token: str | None = None) -> Server:
        """Let clients come over the network, each `RemoteClient` to its place, others to look; see `Server`."""
        if self._ran:
            raise ModelError(
                "serve: found a controller that has run, expected it before; serve first, then run"
            )
        if Server.name in [line.name for line in self._lines]:
            raise ModelError(
                f"serve: found a client named '{Server.name}', expected none, as a controller serves at one port under this "
                "name"
            )
        server = Server(self, [line.client for line in self._lines], port=port, host=host, token=token)
        self.attach(server)
        return server

    def set(self, name: str, value: ArrayLike, *, at: float | None = None) -> None:
        """Set a tunable parameter at the next sample, or from `at`, s. ModelError for a value that is none."""
        if name not in self.tunables:
            raise ModelError(
                f"set: there is no parameter '{name}'{did_you_mean(str(name), self.tunables.names)}"
            )
        channel = self.tunables[name]
        values = Declaration([channel]).vector({name: value})
        if refusal := Declaration([channel]).refusal(values):
            raise ModelError(f"set: {refusal}")

        def act(log: SampleLog) -> None:
            self._tuned[self.tunables.slices[name]] = values
            if name in self._law.tunables:
                self._law.set(name, values)
            log.tell("set", k=self.k, name=name, value=values.tolist())

        self._changes.add(act, at)

    def idle(self, *, at: float | None = None) -> None:
        """From the next sample on, or from `at`, s: nothing is sent; references are nominal."""
        self._switch("idle", at)

    def submit(self, *, at: float | None = None) -> None:
        """From the next sample on, or from `at`, s: clients are given samples; references are nominal."""
        self._switch("submit", at)

    def obtain(self, *, at: float | None = None) -> None:
        """From the next sample on, or from `at`, s: references are those of the user's controller."""
        self._switch("obtain", at)

    def replace_kinematics(self, kinematics: ExternalKinematics) -> None:
        """Other kinematics of the same poses and axes. ModelError while it is not idle: axes would jump under a client."""
        state = self._coming if self._coming != "idle" or self.k < 0 else self._state
        if state != "idle":
            raise ModelError(
                f"kinematics: found the state '{state}', expected 'idle', in which alone they may be replaced; "
                "call .idle() first"
            )
        self._path.replace(kinematics)

    def run(self, stop: float, *, log: str | os.PathLike[str] | None = None) -> ControlledResult:
        """Samples 0, 1, ... at multiples of the period until `stop`, s, as one result, a row for each.

        `applied.x` is what the plant is given as x; log: a file of JSON, one object a line. Ctrl-C ends it at a sample,
        and the result is what was run until then (`.ended` says so), as it is where a plant ends by itself. Raises
        ModelError for a second run and a start beyond limits, SolveError with `.result` where the plant, the controller or a
        reference fails, or a client keeps the virtual clock waiting.
        """
        if self._ran:
            raise ModelError(
                "controller: found a second run, expected one; make another Controller, which begins anew"
            )
        count = int(number("controller", "stop", stop, above=0.0, unit="s") / self.period + ROUNDING)
        drives, self._ran = self._drives(float(stop)), True
        applied = [Channel(f"applied.{c.name}", c.unit, c.size) for c in self._plant.inputs]
        begin = time.perf_counter()
        kept = SampleLog([*self._board.declaration, *applied], self.period, log)
        with kept, on_interrupt(self._press):
            ended = ""
            try:
                self._begin(drives, float(stop))
                ended = self._samples(count, drives, kept)
            except RunEnded as error:
                ended = error.reason
            except KeyboardInterrupt:  # pressed again, in what did not come back
                ended = "interrupted"
            except GantryTauError as error:
                ended = str(error)
                if isinstance(error, SolveError) and kept.count:
                    error.result = self._result(kept, ended, begin)
                raise
            finally:
                self._close()
                kept.tell("end", ended=ended, samples=kept.count, **self.timing.counts())
        if not kept.count:
            raise SolveError("controller: interrupted before its first sample", time=0.0)
        return self._result(kept, ended, begin)

    @property
    def plant_inputs(self) -> dict[str, str] | None:
        """Scalar references that a law of `under` gives, with their units; None where the user's controller gives them."""
        return None if self._led else _units(self._path.declaration)

    @property
    def plant_outputs(self) -> dict[str, str]:
        """What is measured of the plant: scalars with their units."""
        return _units(self._plant.outputs)

    def under(
        self,
        law: PeriodicFunction,
        *,
        every: int,
        known: Sequence[str],
        gives: Mapping[str, str],
        stop: float,
    ) -> ControlledResult:
        """`run` with law(t, {known: value}) -> {name: value} called at every so many samples, as the one that an Mpc has.

        gives: name -> unit. Without a controller of the user the law gives references, at once: `applied.x` in the result.
        Else it is a client `mpc` in a thread, `mpc.x` are its answers, and that to sample k acts in sample k + every.
        """
        if not self._led:
            self._law = PeriodicLaw(law, every, known, list(gives))
            self._law.fit(self._board, self._path.declaration)
            return self.run(stop)
        self.attach(PeriodicClient(LED, law, every, known, gives))
        found = self.run(stop)
        if failure := found.timing.clients[LED].failure:
            raise SolveError(f"controller: the client {LED} {failure}", time=found.time[-1], result=found)
        return found

    def _samples(self, count: int, drives: Sequence[Drive], log: SampleLog) -> str:
        """All samples; why they ended."""
        measured, asked = self._measured, False
        self._clock.begin()
        for k in range(count + 1):
            self._clock.until(k, self._lines if asked else (), lambda: bool(self._pressed))
            if self._pressed:
                return "interrupted"
            self.k, t = k, k * self.period
            self._changes.act(k, log)
            nominal = _nominal(drives, t)
            for group, values in zip(_GROUPS, (self._tuned, measured, nominal), strict=True):
                self._board.put(group, values)
            self._board.values[0] = STATES.index(self._state)
            self._exchange(k, asked)
            asked = self._state != "idle"
            wanted = self._law.references(k, t, self.period, nominal)
            applied = self._path.follow(wanted if self._state == "obtain" else nominal)
            log.add(np.concatenate([self._board.values, applied]))
            if k < count:
                measured = self._plant.finite_step(t, self.period, applied)
        return "stop"

    def _exchange(self, k: int, asked: bool) -> None:
        """Sample k to all clients, and what they say to sample k - 1, which they have been given if `asked`."""
        if self._state == "idle":
            return
        values = self._board.values[: self._board.published.size]
        sample = Sample(k, round(k * self.period * 1e9), values)
        for line in self._lines:
            line.submit(sample, self._board.published)
        if self._state == "obtain" and asked:
            for line in self._lines:
                self._board.put(line.name, line.obtain(k))

    def _begin(self, drives: Sequence[Drive], stop: float) -> None:
        nominal = np.array([drive(0.0) for drive in drives])
        self._measured = self._plant.begin(self._path.begin(nominal), stop)
        for group, values in zip(_GROUPS, (self._tuned, self._measured, nominal), strict=True):
            self._board.put(group, values)
        for line in self._lines:
            self._board.put(line.name, line.values)
        self._law.begin(stop + self.period)  # it takes the last sample, too

    def _switch(self, state: State, at: float | None) -> None:
        def act(log: SampleLog) -> None:
            self._state = state
            if at is not None:
                self._coming = state
            log.tell("state", k=self.k, state=state)

        self._changes.add(act, at)
        if at is None:
            self._coming = state

    def _press(self) -> None:
        """Ctrl-C: the run ends at the next sample; pressed again, where it is."""
        self._pressed += 1
        if self._pressed > 1:
            raise KeyboardInterrupt

    def _close(self) -> None:
        for line in self._lines:
            line.close()
        self._law.close()
        self._plant.close()

    def _result(self, kept: SampleLog, ended: str, begin: float) -> ControlledResult:
        self._wall = time.perf_counter() - begin
        names = kept.declaration.elements
        units = {name: c.unit for c in kept.declaration for name in c.elements}
        return ControlledResult(
            self.period * np.arange(kept.count),
            dict(zip(names, kept.rows.T.copy(), strict=True)),
            units=units,
            title=f"controller of {self._plant.component.file}",
            held=[name for name in names if name not in self._plant.outputs.elements],
            ended=ended,
            modes={"state": STATES},
            timing=self.timing,
        )

    def _line(self, client: Client) -> ClientLine:
        if not isinstance(client, Client):
            raise ModelError(
                f"clients: found {client!r}, expected name, sends, submit, answer, settled and close, see `clients.py`"
            )
        Channel(client.name, "1")  # its name begins those of channels, and obeys their rules
        if client.name in {line.name for line in self._lines} | set(_GROUPS):
            raise ModelError(f"clients: found '{client.name}' twice, expected each name once; rename one")
        return ClientLine(client)

    def _made_board(self) -> Board:
        groups = (self.tunables, self._plant.outputs, self._path.declaration)
        board = Board(
            dict(zip(_GROUPS, groups, strict=True)), {line.name: line.sends for line in self._lines}
        )
        self._law.fit(board, self._path.declaration)
        return board

    def _drives(self, stop: float) -> list[Drive]:
        found, first = list[Drive](), self._plant.first_inputs
        for channel in self._path.declaration:
            value = self._references.get(channel.name)
            if value is None:
                value = first[self._plant.inputs.slices[channel.name]]
            found += drives_of("references", channel.name, value, channel.size, (0.0, stop))
        return found


def _nominal(drives: Sequence[Drive], t: float) -> Values:
    """The references at t, s; SolveError where a function of the user has no value there."""
    try:
        return np.array([drive(t) for drive in drives])
    except ModelError as error:
        raise SolveError(str(error), time=t) from error


def _units(declaration: Declaration) -> dict[str, str]:
    return {name: channel.unit for channel in declaration for name in channel.elements}


LED = "mpc"  # the client that is a law of `under`
_GROUPS = ("the parameters", "the plant", "the references")
