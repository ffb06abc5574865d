"""Filters that run forwards and then backwards in time, so that nothing is shifted: Q of learning control.

    Qbar = Qc' Qc,  |Qbar(f)| = |Qc(f)|^2                                    Dressler (2012), (7.11), (7.13)

Qc is the causal filter from rest, and backwards from rest as well, so that it is one matrix over a whole run.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array, number, whole
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record


@dataclass(frozen=True)
class BiquadSection:
    """(b2 p^2 + b1 p + b0) / (a2 p^2 + a1 p + a0) with p = s / (2 pi hz); samples of it are true at hz."""

    hz: float
    numerator: tuple[float, float, float]
    denominator: tuple[float, float, float]

    def digital(self, period: float) -> np.ndarray:
        """Coefficients (6,) of z^0, z^-1, z^-2 above and below, by p = (z - 1) / (z + 1) / tan(pi hz period)."""
        k = 1 / np.tan(np.pi * self.hz * period)
        square, even, one = np.array([1, -2, 1]) * k**2, np.array([1, 0, -1]) * k, np.array([1, 2, 1])
        over, under = (x[0] * square + x[1] * even + x[2] * one for x in (self.numerator, self.denominator))
        return np.concatenate([over, under]) / under[0]


@dataclass(frozen=True)
class ZeroPhase(Record):
    """A zero-phase filter for each axis, or one for all: sections of the causal half by axis."""

    axes: tuple[tuple[BiquadSection, ...], ...]

    @classmethod
    def butterworth(cls, order: int, hz: float | Sequence[float]) -> Self:
        """Low-pass filters of an order with the cut-off hz, one or one for each axis; -6 dB there, as both ways count.

        Raises ModelError for what is no order or no frequency.
        """
        whole("ZeroPhase.butterworth", "order", order, least=1, most=20)
        return cls(tuple(_low_pass(order, float(f)) for f in _frequencies(hz)))

    def notched(self, hz: float, width: float, depth: float) -> Self:
        """With a notch in all axes: gain depth^2 at hz; width: the damping ratio of its poles."""
        return type(self)(tuple((*sections, notch(hz, width, depth)) for sections in self.axes))

    def joined(self, *others: "ZeroPhase") -> "ZeroPhase":
        """The axes of several, in order."""
        return ZeroPhase(tuple(axis for each in (self, *others) for axis in each.axes))

    def of(self, axis: int, count: int) -> tuple[BiquadSection, ...]:
        """The sections of one of count axes. Raises ModelError where there are others."""
        if len(self.axes) not in (1, count):
            raise ModelError(
                f"ZeroPhase: found filters for {len(self.axes)} axes and {count} signals, expected one for each, or "
                "one for all"
            )
        return self.axes[axis if len(self.axes) > 1 else 0]

    def apply(self, x: Any, period: float) -> np.ndarray:
        """Signals (N,), (N, m) or many of these, (N, m, K), filtered forwards and backwards along time, from rest."""
        from scipy.signal import sosfilt

        x = np.asarray(x, dtype=float)
        columns = x[:, None] if x.ndim == 1 else x
        found = np.empty_like(columns)
        for i in range(columns.shape[1]):
            sections = digital(self.of(i, columns.shape[1]), period)
            there = sosfilt(sections, columns[:, i], axis=0)
            found[:, i] = sosfilt(sections, there[::-1], axis=0)[::-1]
        return found[:, 0] if x.ndim == 1 else found

    def magnitude(self, hz: Any, period: float) -> np.ndarray:
        """Gains at frequencies hz (K,), (axes, K)."""
        from scipy.signal import sosfreqz

        rows = [sosfreqz(digital(sections, period), worN=hz, fs=1 / period)[1] for sections in self.axes]
        return np.abs(np.array(rows)) ** 2


def notch(hz: float, width: float, depth: float) -> BiquadSection:
    """(p^2 + 2 width depth p + 1) / (p^2 + 2 width p + 1): gain depth at hz."""
    hz = number("ZeroPhase.notched", "hz", hz, above=0.0)
    width = number("ZeroPhase.notched", "width", width, above=0.0)
    depth = number("ZeroPhase.notched", "depth", depth, least=0.0)
    return BiquadSection(float(hz), (1.0, 2 * width * depth, 1.0), (1.0, 2 * width, 1.0))


def digital(sections: Sequence[BiquadSection], period: float) -> np.ndarray:
    """Second-order sections (K, 6) for scipy. Raises ModelError for frequencies that the period does not hold."""
    for section in sections:
        if not section.hz * period < 0.5:
            raise ModelError(
                f"ZeroPhase: found a frequency of {section.hz:g} Hz beside samples every {period:g} s, expected one below "
                f"half of the sampling frequency, {0.5 / period:g} Hz"
            )
    return np.array([section.digital(period) for section in sections])


def _low_pass(order: int, hz: float) -> tuple[BiquadSection, ...]:
    pairs = [
        BiquadSection(hz, (0.0, 0.0, 1.0), (1.0, 2 * math.sin(math.pi * (2 * k + 1) / (2 * order)), 1.0))
        for k in range(order // 2)
    ]
    return (*pairs, *([BiquadSection(hz, (0.0, 0.0, 1.0), (0.0, 1.0, 1.0))] if order % 2 else []))


def _frequencies(hz: Any) -> np.ndarray:
    """Frequencies in Hz, (k,); ModelError unless all are above zero."""
    found = np.atleast_1d(array("ZeroPhase.butterworth", "hz", hz, (), (None,)))
    if not found.size or not np.all(found > 0):
        expected = "expected frequencies above zero in Hz"
        raise ModelError(expected, place="ZeroPhase.butterworth", found=Given("hz", hz))
    return found
