"""`rig.toml`: a robot, what differs from run to run, a motion, and ways to learn it."""

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import GantryTauError, ModelError, did_you_mean, read_toml
from gantrytau.border.columns import Columns
from gantrytau.border.named import named
from gantrytau.border.schema import Value, at, read_table
from gantrytau.describing.record import Record
from gantrytau_optimica.learning.filters.tukey import Tukey
from gantrytau_optimica.learning.rig import Rig
from gantrytau_optimica.learning.run_variation import Scatter
from gantrytau_optimica.learning.runs.reference import Reference, square_reference
from gantrytau_optimica.learning.runs.robot_runs import Plant

TEXT, NUMBER, TIME = Value("text"), Value("1"), Value("s", above=0.0)
WHOLE, LENGTH = Value("whole", least=0), Value("m", above=0.0)
RIG = {"record": TEXT, "plant": TEXT, "period": TIME, "place": Value("m", ((3,),))}
SCATTER = {
    "encoder": Value("m", least=0.0),
    "gauge": Value("m", least=0.0),
    "accelerometer": Value("1", least=0.0),
    "level": Value("1", least=0.0),
    "rest": Value("1", least=0.0),
}
REFERENCE = {
    "file": TEXT,
    "size": LENGTH,
    "move": TIME,
    "edge": TIME,
    "rounds": Value("whole", least=1),
    "begin": TIME,
    "duration": TIME,
}
LEARNING = {
    "window": Value("s", ((2,),), least=0.0),
    "lead": Value("s", least=0.0),
    "gain": NUMBER,
    "shift": WHOLE,
    "iterations": WHOLE,
    "seed": WHOLE,
}
ESTIMATORS = ("actuators", "kinematic", "complementary", "kalman", "measured")
LAWS = ("shifted", "gradient", "norm-optimal")
CASE = {
    "name": TEXT,
    "estimator": Value("text", words=ESTIMATORS),
    "law": Value("text", words=LAWS),
    "cut_off": Value("1", above=0.0),
    "open_to": Value("1", above=0.0),
    "gain": NUMBER,
    "shift": WHOLE,
}
LIBRARY = "gantrytau_models"  # of records and models that a file names
TABLES = ("rig", "scatter", "reference", "learning", "case")
RIG_EXAMPLE = """\
# A robot that learns a motion, in several ways. Make this file your own, then: gantrytau learn rig.toml
# Numbers are in SI; a text may bring another unit, as "4 ms" or "10 mm". Frequencies are in Hz.

[rig]
record = "L1_flexible"     # a Gantry-Tau robot that gives way, under its servos; or a plant of your own:
# plant = "robot.py:rig"   # what has .period, .kinematics and .run(position, velocity, seed), or a function that makes it
period = "4 ms"
# place = ["0.9 m", "2.7 m", "-0.7 m"]  # of the tool, where the square begins

[scatter]                  # what differs from run to run; without this table nothing does
encoder = "1 um"           # standard deviations of noise
gauge = "1 um"
accelerometer = 0.07       # m/s2
level = 0.1                # friction is drawn within these parts of its value
rest = 0.6                 # and rests at the start within these parts of it

[reference]                # a square in x and y, which stops in each corner
size = "10 mm"
rounds = 2
# move = "220 ms"          # of motion along an edge, of edge = "412 ms" with its stop; after begin = "1.2 s" of rest, in
                           # duration = "4.8 s" of the run
# file = "motion.csv"      # or a motion of your own: columns t,x,y,z in s and m, from rest

[learning]
window = ["1.2 s", "4.5 s"]  # what is learnt of a run
lead = "400 ms"              # in which it fades in and out
gain = 0.9                   # L = gain q^shift; a case may have its own
shift = 5
iterations = 10
seed = 1

[[case]]                   # as many as there are
name = "1"
estimator = "actuators"    # or kinematic, complementary, kalman, measured
cut_off = 10.0             # Hz, of Q, a Butterworth filter of order 2 both ways
# law = "norm-optimal"     # or gradient: by the response that is measured, with a higher cut_off, in place of the shift

[[case]]
name = "2A"
estimator = "complementary"
open_to = 30.0             # Hz: Q is designed, open as far as convergence allows

[[case]]
name = "2B"
estimator = "kalman"       # by a model that is identified first
open_to = 30.0

[[case]]
name = "3"
estimator = "measured"
open_to = 30.0
"""


@dataclass(frozen=True)
class CaseOfFile:
    """One way to learn. cut_off: Hz of a plain Q, or open_to, up to where Q is designed to be open; gain, shift: of L."""

    name: str
    estimator: str
    law: str = "shifted"
    cut_off: float | None = None
    open_to: float | None = None
    gain: float = 0.9
    shift: int = 5


@dataclass(frozen=True)
class RigFile(Record):
    """What a file says: a plant, made when it is asked for, a motion, what is learnt of it, and ways to learn."""

    file: Path
    table: Mapping[str, Any]
    scatter: Scatter | None
    reference: Reference
    window: Tukey
    iterations: int
    seed: int
    cases: tuple[CaseOfFile, ...]

    def changed(
        self, *, iterations: int | None = None, seed: int | None = None, names: tuple[str, ...] = ()
    ) -> "RigFile":
        """With other numbers where they are not None, and the named cases alone, all if none. Raises ModelError."""
        known = [case.name for case in self.cases]
        for name in names:
            if name not in known:
                raise ModelError(
                    f'{self.file}: found no case "{name}"{did_you_mean(name, known)}', argument="case"
                )
        return replace(
            self,
            iterations=self.iterations if iterations is None else iterations,
            seed=self.seed if seed is None else seed,
            cases=tuple(case for case in self.cases if not names or case.name in names),
        )

    @property
    def fitted(self) -> str:
        """What numbers of the robot are fitted to printed results, as its record says."""
        return record_of(f"{self.file}: rig", self.table["record"]).fitted if "record" in self.table else ""

    def plant(self) -> Plant:
        """The robot under its servos. Raises ModelError, with the place in the file, where there is none."""
        place = f"{self.file}: rig"
        if "plant" in self.table:
            return _own_plant(at(place, "plant"), self.table["plant"], self.file.parent)
        record = record_of(place, self.table["record"])
        models = importlib.import_module(LIBRARY)
        try:
            r, period = self.reference.r[0], self.reference.period
            robot = models.FlexibleGantryTau(record, friction=models.PreslidingFriction, r=r)
            servos = models.cart_servos(record, r=r, period=period)
            return Rig(robot, servos, period=period, noise=self.scatter, stiff=models.GantryTau(record))
        except GantryTauError as error:
            raise error.within(place) from error


def read_rig(path: str | Path) -> RigFile:
    """The file of a rig, such as `RIG_EXAMPLE`; numbers are SI, texts bring a unit.

    Raises ModelError with the place in it.
    """
    file = Path(path)
    table = read_toml(file)
    whole = f"{file}: "
    read_table(whole, table, dict.fromkeys(TABLES, Value("bodies")))
    missing = [name for name in ("rig", "reference", "case") if name not in table]
    if missing:
        raise ModelError(
            f"{whole}found no table [{missing[0]}], expected one; `gantrytau learn --example` prints a whole file"
        )
    rig = read_table(f"{whole}rig", table["rig"], RIG)
    if ("record" in rig) == ("plant" in rig):
        raise ModelError(
            f"{whole}rig: found {'both' if 'plant' in rig else 'neither'} of record and plant, expected one"
        )
    if "record" in rig:
        record_of(f"{whole}rig", rig["record"])
    scatter = read_table(f"{whole}scatter", table["scatter"], SCATTER) if "scatter" in table else None
    learning = read_table(f"{whole}learning", table.get("learning", {}), LEARNING)
    start, stop = learning.get("window", (None, None))
    return RigFile(
        file,
        rig,
        None if scatter is None else _made(f"{whole}scatter", Scatter, scatter),
        _reference(f"{whole}reference", table["reference"], rig, file.parent),
        Tukey(start, stop, lead=learning.get("lead", 0.4)),
        learning.get("iterations", 10),
        learning.get("seed", 0),
        _cases(whole, table["case"], {k: learning[k] for k in ("gain", "shift") if k in learning}),
    )


def record_of(place: str, name: str) -> Any:
    """A record of a robot that gives way, by name."""
    prototypes = importlib.import_module(f"{LIBRARY}.prototypes")
    found = getattr(prototypes, name, None) if name in dir(prototypes) else None
    if not isinstance(found, prototypes.FlexiblePrototype):
        raise ModelError(
            f'{at(place, "record")}: found "{name}", expected a record that says how a robot gives way, such as '
            "L1_flexible; or plant"
        )
    return found


def _reference(place: str, table: Any, rig: Mapping[str, Any], folder: Path) -> Reference:
    own = read_table(place, table, REFERENCE)
    if "file" not in own:
        more = {k: rig[k] for k in ("period",) if k in rig} | (
            {"start": tuple(rig["place"])} if "place" in rig else {}
        )
        return _made(place, square_reference, own | more)
    if len(own) > 1:
        raise ModelError(
            f"{place}: found a file beside {', '.join(n for n in own if n != 'file')}, expected one of both"
        )
    read = Columns.read(folder / own["file"], "one line for each time")
    if read.time is None:
        raise ModelError(f"{read.path}: found the columns {', '.join(read.names)}, expected t, x, y, z")
    return _made(
        place,
        Reference,
        dict(t=read.time, r=np.column_stack([read.column(x, "m", filled=True) for x in "xyz"])),
    )


def _cases(whole: str, entries: Any, common: Mapping[str, Any]) -> tuple[CaseOfFile, ...]:
    if not isinstance(entries, list) or not entries:
        raise ModelError(f"{whole}case: found {entries!r}, expected a table for each, [[case]]")
    found = []
    for k, entry in enumerate(entries):
        place = f"{whole}case[{k}]"
        own = read_table(place, entry, CASE, ("name", "estimator"))
        if ("cut_off" in own) == ("open_to" in own):
            raise ModelError(
                f"{place}: found {'both' if 'open_to' in own else 'neither'} of cut_off and open_to, expected one: Hz of a "
                "plain Q, or up to where Q is designed to be open"
            )
        if any(case.name == own["name"] for case in found):
            raise ModelError(
                f'{at(place, "name")}: found "{own["name"]}" twice, expected a name for each case'
            )
        if "open_to" in own and own.get("law", "shifted") != "shifted":
            raise ModelError(
                f"{place}: found open_to with the law {own['law']}, which goes by a model; give it a cut_off"
            )
        found.append(CaseOfFile(**{**common, **own}))
    return tuple(found)


def _own_plant(place: str, name: str, folder: Path) -> Plant:
    """What a Python file names: a plant, or a function that makes one."""
    try:
        found: Any = named(name, folder, LIBRARY)
        found = found() if callable(found) and not hasattr(found, "run") else found
    except (GantryTauError, ImportError, OSError, ValueError, KeyError, AttributeError, TypeError) as error:
        raise ModelError(
            f'{place}: found "{name}", which cannot be made ({error}), expected robot.py:rig, a plant or a function that '
            "makes one"
        ) from error
    lacking = [word for word in ("run", "period", "kinematics") if not hasattr(found, word)]
    if lacking:
        raise ModelError(
            f'{place}: found "{name}" without {", ".join(lacking)}, expected a plant, such as a Rig'
        )
    return found


def _made(place: str, make: Any, values: Mapping[str, Any]) -> Any:
    try:
        return make(**values)
    except ModelError as error:
        raise error.within(place) from error
