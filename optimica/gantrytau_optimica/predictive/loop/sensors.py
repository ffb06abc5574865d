"""What a controller is told of a plant at a sample: its state with noise, or what an estimator makes of outputs."""

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from gantrytau import DoubtfulResult, ModelError
from gantrytau.border.checks import instance, number
from gantrytau.border.refusal import Given
from gantrytau_optimica.predictive.estimators.state_estimator import StateEstimator
from gantrytau_optimica.predictive.loop.closed_loop import LoopEnd


class Sensors:
    """What the controller is told of the plant at a sample: its state with noise, or what an estimator makes of outputs."""

    def __init__(
        self,
        mpc: Any,
        noise: Mapping[str, Any],
        seed: int,
        estimator: StateEstimator | None,
    ):
        if estimator is not None:
            instance("run", "estimator", estimator, StateEstimator, "a MovingHorizon or an ExtendedKalman")
        self.mpc, self.estimator = mpc, estimator
        self.names = mpc.states if estimator is None else estimator.outputs
        self._spread = np.zeros(len(self.names))
        for name, value in noise.items():
            if name not in self.names:
                raise ModelError(
                    f"expected {'states of' if estimator is None else 'some of what is measured,'} "
                    f"{', '.join(self.names)}",
                    place="run",
                    found=Given("noise", name),
                )
            unit = mpc.built.read.dae.flat.unit(name)
            self._spread[self.names.index(name)] = number(
                "run", f"noise[{name}]", value, unit=unit, least=0.0
            )
        self.random = np.random.default_rng(seed)
        self._estimates: list[dict[str, float]] = []
        if estimator is not None:
            self._check(estimator)
            estimator.reset()

    def _check(self, estimator: StateEstimator) -> None:
        mpc, given = self.mpc, (*estimator.states, *estimator.parameters)
        lacking = [name for name in (*mpc.states, *mpc.estimated) if name not in given]
        if lacking:
            words = f"the estimator does not estimate {', '.join(lacking)}, which the controller takes"
            raise ModelError(
                f"{words}; let both have the same problem, parameters= and disturbance=", place=mpc.name
            )
        unused = [name for name in estimator.parameters if name not in mpc.estimated]
        if unused:
            warnings.warn(
                f"{mpc.name}: the controller does not take what is estimated of {', '.join(unused)}; name them in "
                "Mpc(..., parameters=) or disturbance=",
                DoubtfulResult,
                stacklevel=5,
            )
        if estimator.period != mpc.period:
            words = f"the estimator has a period of {estimator.period:g} s, expected {mpc.period:g} s as the controller has"
            raise ModelError(words, place=mpc.name)

    @property
    def estimates(self) -> dict[str, np.ndarray]:
        """Courses of the estimates by name."""
        first = self._estimates[0] if self._estimates else {}
        return {name: np.array([one[name] for one in self._estimates]) for name in first}

    @property
    def memory(self) -> tuple[str, Mapping[str, Any]] | None:
        """The estimator's kind, what it estimates of what, and its memory."""
        if (one := self.estimator) is None:
            return None
        return (
            f"{type(one).__name__} of {', '.join(one.observed.names)} from {', '.join(one.outputs)}",
            one.memory,
        )

    def goes_on(self, end: LoopEnd, estimates: Mapping[str, np.ndarray]) -> None:
        """Be as where a loop ended; ModelError for another estimator."""
        own = self.memory
        was, now = (None if memory is None else memory[0] for memory in (end.estimator, own))
        if was != now:
            words = f"found the estimator {now or 'None'}, expected that of the loop before, {was or 'None'}"
            raise ModelError(words, place="run", argument="estimator")
        if self.estimator is not None and end.estimator is not None:
            self.estimator.recall(end.estimator[1])
            columns = zip(*estimates.values(), strict=True)
            self._estimates = [dict(zip(estimates, map(float, row), strict=True)) for row in columns]
        self.random.bit_generator.state = end.random

    def told(self, measured: np.ndarray, inputs: Mapping[str, float], t: float) -> dict[str, float]:
        """The state as the controller is told it, with estimates. measured: of `names`; inputs: those held until t."""
        y = measured + self._spread * self.random.standard_normal(len(self.names))
        named = dict(zip(self.names, y.tolist(), strict=True))
        if self.estimator is None:
            return named
        found = self.estimator.step(named, inputs, t)
        self._estimates.append(found)
        return {name: found[name] for name in (*self.mpc.states, *self.mpc.estimated)}
