"""Flat patterns that a robot carries, or that stand beside it: where their corners are, and how black they are."""

from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from gantrytau.border.checks import number, one_of, whole
from gantrytau_optimica.vision.opencv import opencv

Array = np.ndarray
BLACK = np.array([[-1, 1], [1, 1], [0, 0], [-1, -1], [1, -1]])  # cells from the middle, x to the right, y up
AROUND = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]])  # corners of a cell: upper left, and so on clockwise
MARKER = 0.75  # of a cell, the side of its marker
DOTS = 24  # of a cell, in the drawing that a board's markers are read from


@dataclass(frozen=True)
class Pattern:
    """A flat pattern of squares. Its axes: x to the right, y up, z towards who looks at it; its origin is its middle.

    kind: "quincunx" or "charuco"; side: of a cell in m; columns, rows: how many cells. Make one by `Pattern.quincunx` or
    `Pattern.charuco`. `points` are the corners that detections hold.
    """

    kind: Literal["quincunx", "charuco"]
    side: float
    _: KW_ONLY
    columns: int = 3
    rows: int = 3

    def __post_init__(self):
        for name in ("columns", "rows"):
            whole("Pattern", name, getattr(self, name), least=3)
        number("Pattern", "side", self.side, above=0.0, most=1.0)  # m, not mm
        one_of("Pattern", "kind", self.kind, ("quincunx", "charuco"))

    @classmethod
    def quincunx(cls, side: float) -> "Pattern":
        """Five black squares of a chessboard of 3 x 3 cells, as of thesis section 5.5; side of a cell in m.

        It looks the same after a quarter of a turn: which of its sides is up is taken from the image.
        """
        return cls("quincunx", side)

    @classmethod
    def charuco(cls, columns: int, rows: int, side: float) -> "Pattern":
        """A chessboard with numbered markers in its white cells (DICT_4X4_50), side of a cell in m.

        Its markers tell which corner is which, also where a part of it is hidden, and however it is turned.
        """
        return cls("charuco", side, columns=columns, rows=rows)

    @cached_property
    def points(self) -> Array:
        """Corners in m, (P, 3). Quincunx: 20, four of each square clockwise from the upper left; the squares are upper
        left, upper right, middle, lower left, lower right. ChArUco: inner corners, line by line from the upper left.
        """
        if self.kind == "quincunx":
            flat = ((BLACK[:, None] + AROUND / 2) * self.side).reshape(-1, 2)
        else:
            x = np.arange(1, self.columns) - self.columns / 2
            y = self.rows / 2 - np.arange(1, self.rows)
            flat = self.side * np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return np.column_stack([flat, np.zeros(len(flat))])

    @property
    def extent(self) -> Array:
        """Width and height of all cells in m, (2,)."""
        return self.side * np.array([self.columns, self.rows])

    @property
    def board(self) -> Any:
        """OpenCV's board of a ChArUco pattern."""
        aruco = opencv().aruco
        words = aruco.getPredefinedDictionary(aruco.DICT_4X4_50)
        return aruco.CharucoBoard((self.columns, self.rows), self.side, MARKER * self.side, words)

    def blackness(self, x: Array, y: Array, footprint: float) -> Array:
        """How much of squares of side `footprint` (m) about points x, y (m) is black, from 0 to 1; 0 beyond the cells."""
        if self.kind == "charuco":
            return self._drawn(x, y)
        column, inside_x = _bands(x / self.side, footprint / self.side)
        row, inside_y = _bands(y / self.side, footprint / self.side)
        return (inside_x * inside_y + column * row) / 2

    def _drawn(self, x: Array, y: Array) -> Array:
        cv2 = opencv()
        sheet = self.board.generateImage((self.columns * DOTS, self.rows * DOTS), marginSize=0, borderBits=1)
        dots = DOTS / self.side
        across = (x + self.extent[0] / 2) * dots - 0.5
        down = (self.extent[1] / 2 - y) * dots - 0.5
        black = 1.0 - sheet.astype(np.float32) / 255
        flat = (across.astype(np.float32), down.astype(np.float32))
        return cv2.remap(black, *flat, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0)


def _bands(x: Array, width: float) -> tuple[Array, Array]:
    """Means over a width of +1, -1, +1 in three cells about 0, zero beyond, and of 1 in all of them."""
    steps = [np.clip((x - edge) / width + 0.5, 0.0, 1.0) for edge in (-1.5, -0.5, 0.5, 1.5)]
    return steps[0] - 2 * steps[1] + 2 * steps[2] - steps[3], steps[0] - steps[3]
