"""What a camera makes of directions: focal lengths, centre, lens and sensor, wherever it stands."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import ModelError, read_toml
from gantrytau.border.checks import array
from gantrytau.border.refusal import Given
from gantrytau.border.schema import Value, read_table
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.devices.cameras import UP, PlacedCamera

Array = np.ndarray
LENS = 5  # k1, k2, p1, p2, k3
NEWTON = 20  # steps from an image point to its direction; four are enough for usual lenses
SETTLED = 1e-12  # of x and y at depth 1: 1e-9 pixel
KEYS = {
    "K": Value("1", ((3, 3),)),
    "distortion": Value("1", ((LENS,),)),
    "size": Value("whole", ((2,),), least=1),
}


@dataclass(frozen=True, eq=False)
class Camera(Record):
    """A camera of which only the images are known: not where it stands, but what it makes of directions.

    K: ((f_x, 0, c_x), (0, f_y, c_y), (0, 0, 1)) in pixels, the middle of the first pixel at (0, 0); distortion: k1, k2,
    p1, p2, k3 of Brown and Conrady, as of OpenCV; size: (width, height) in pixels.
    Raises ModelError for other shapes, a skew, focal lengths that are not above zero and a centre off the sensor.
    """

    K: Any
    distortion: Any = (0.0,) * LENS
    size: Any = (1024, 768)

    def __post_init__(self):
        size = array("Camera", "size", self.size, (2,))
        K = array("Camera", "K", self.K, (3, 3))
        lens = array("Camera", "distortion", self.distortion, (LENS,))
        if not np.all((size >= 1) & (size == np.round(size))):
            wrong = Given("size", self.size)
            raise ModelError("expected (width, height), whole pixels above 0", place="Camera", found=wrong)
        focal, centre = np.diag(K)[:2], K[:2, 2]
        if np.any(K[[0, 1, 2, 2, 2], [1, 0, 0, 1, 2]] != [0, 0, 0, 0, 1]) or not np.all(focal > 0):
            raise ModelError(
                "expected ((f_x, 0, c_x), (0, f_y, c_y), (0, 0, 1)), f in pixels above 0; a skew is not modelled",
                place="Camera",
                found=Given("K", self.K),
            )
        if not np.all((centre > -0.5) & (centre < size - 0.5)):
            raise ModelError(
                f"found the centre {centre.tolist()} outside of an image of {size[0]:g} x {size[1]:g}, expected "
                "K and size of the same images; scale K with them",
                place="Camera",
                argument="K",
            )
        for name, value in (("K", K), ("distortion", lens), ("size", tuple(int(n) for n in size))):
            object.__setattr__(self, name, value)

    @classmethod
    def read(cls, toml: str | os.PathLike[str]) -> "Camera":
        """A camera from a file with the keys K, size and perhaps distortion; ModelError with the key that is wrong."""
        path = Path(toml)
        return cls(**read_table(f"{path.name}: ", read_toml(path), KEYS, ("K", "size")))

    @classmethod
    def guess(cls, size: Any, focal: float) -> "Camera":
        """A camera with square pixels, its centre in the middle and no distortion: size (width, height), focal in pixels."""
        width, height = array("Camera.guess", "size", size, (2,))
        return cls([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]], size=size)

    def write(self, toml: str | os.PathLike[str]) -> None:
        """Write the file that `read` reads."""
        lines = (f"{name} = {np.asarray(getattr(self, name)).tolist()}" for name in KEYS)
        Path(toml).write_text("\n".join(lines) + "\n", encoding="utf-8")

    def placed(self, r: Any, R: Any) -> PlacedCamera:
        """This camera at r (3,) in m with axes R (3, 3), which projects points of the world."""
        return PlacedCamera(
            r, R, focal=np.diag(self.K)[:2], centre=self.K[:2, 2], size=self.size, distortion=self.distortion
        )

    def looking(self, r: Any, at: Any, *, up: Any = UP) -> PlacedCamera:
        """This camera at r, looking at a point, the upper edge of its image towards `up`."""
        return self.placed(r, PlacedCamera.looking(r, at, up=up).R)

    def directions(self, pixels: Any) -> Array:
        """Coordinates x and y at depth 1, (..., 2), of image points (..., 2) in pixels; NaN where none is found.

        Newton's method on the projection, from the direction without a lens.
        """
        pixels = np.asarray(pixels, dtype=float)
        here = self.placed(np.zeros(3), np.eye(3))
        found = (pixels - self.K[:2, 2]) / np.diag(self.K)[:2]
        step = np.inf
        for _ in range(NEWTON):
            points = np.concatenate([found, np.ones_like(found[..., :1])], axis=-1)
            images, slopes = here.slopes(points)
            with np.errstate(invalid="ignore"):
                step = np.linalg.solve(slopes[..., :2], (pixels - images)[..., None])[..., 0]
            found = found + step
            if not np.any(np.abs(step) > SETTLED):
                return found
        return np.where(np.all(np.abs(step) <= SETTLED, axis=-1, keepdims=True), found, np.nan)
