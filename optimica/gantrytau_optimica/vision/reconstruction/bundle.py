"""The images of a pattern at all poses as one least squares: cameras, lenses, pattern and poses at once.

Shared unknowns, in this order: of each camera its lens (focal length, centre, k1, k2), of each but the first where it
stands; how the pattern is turned, where it always is alike; its size, where spacing tells it; where each line of poses
begins on the guideways. Own unknowns are those of a pose: place, and perhaps orientation, or the place of a corner alone.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gantrytau.kinematics.rotations import skewed, turned
from gantrytau_optimica.calibration.devices.cameras import PlacedCamera
from gantrytau_optimica.fitting.blocks import BlockRows
from gantrytau_optimica.vision.intrinsics import Camera
from gantrytau_optimica.vision.reconstruction.spacing import Spacing

Array = np.ndarray
LENS = 5  # unknowns of a lens: logarithm of the focal length, centre, k1, k2
PLACE = 6  # of a camera: turn and shift
PRIOR = np.array([0.05, 30.0, 30.0, 0.3, 0.5])  # standard deviations of what was given of a lens, assumed
FILLED = 1.0  # m, deviation of a corner of its own of which nothing is known
LONGEST = 0.5  # of the logarithm of a focal length, in one step
BEHIND = 1e9  # error of a corner that was seen and would be behind its camera
GAUGE = 1e-6  # of the base: how well it is held where nothing tells a length


@dataclass(frozen=True, eq=False)
class TakenAsKnown:
    """What the bundle takes for known: whether lenses are estimated; whether corners are those of a plate, or each alone;
    whether the plate always is turned alike; whether its size is unknown; the spacing of poses, or None.
    """

    lenses: bool
    plate: bool
    alike: bool
    sized: bool = False
    spacing: Spacing | None = None


@dataclass(frozen=True, eq=False)
class State:
    """cameras: where they are held to stand, and their lenses; corners (N, P, 3) or, of a plate, r (N, 3), R (N, 3, 3) and
    its size as a multiple; of lines of poses middles to count from (L, 3) and offsets (L,) in m.
    """

    cameras: tuple[PlacedCamera, ...]
    r: Array
    R: Array
    size: float
    corners: Array
    middles: Array
    offsets: Array

    def of(self, poses: Array) -> "State":
        """The state of some of the poses."""
        return replace(self, r=self.r[poses], R=self.R[poses], corners=self.corners[poses])


@dataclass(frozen=True, eq=False)
class Bundle:
    """The least squares of images. pixels: (C, N, P, 2), NaN where missing; weights: (C, N, P) in 1/pixel; points: of the
    pattern (P, 3) in m; given: lenses as they were given.
    """

    pixels: Array
    weights: Array
    points: Array
    given: tuple[Camera, ...]
    told: TakenAsKnown

    @cached_property
    def columns(self) -> dict[str, slice]:
        """Which shared unknowns are which, by name."""
        told, count = self.told, len(self.given)
        sizes = {f"lens {c}": LENS * told.lenses for c in range(count)}
        sizes |= {f"camera {c}": PLACE for c in range(1, count)}
        sizes |= {"turn": 3 * (told.plate and told.alike), "size": int(told.plate and told.sized)}
        lines = 0 if told.spacing is None else told.spacing.lines
        sizes |= {"offsets": lines}
        ends = np.cumsum([0, *sizes.values()]).tolist()
        return {name: slice(a, b) for name, a, b in zip(sizes, ends[:-1], ends[1:], strict=True)}

    @property
    def shared(self) -> int:
        """How many shared unknowns there are."""
        return max(each.stop for each in self.columns.values())

    @cached_property
    def seen(self) -> Array:
        """1 where a corner was found, else 0, (C, N, P); of corners for themselves where two cameras found it."""
        found = np.isfinite(self.pixels[..., 0])
        return (found if self.told.plate else found & (found.sum(axis=0) > 1)).astype(float)

    def of(self, poses: Array) -> "Bundle":
        """The images of some of the poses."""
        return replace(self, pixels=self.pixels[:, poses], weights=self.weights[:, poses])

    def residuals(self, state: State) -> Array:
        """Images less detections, (C, N, P, 2) in pixels, NaN where there are none."""
        points = self.points_at(state)
        images = np.stack([camera.project(points) for camera in state.cameras])
        return np.where(self.seen[..., None] > 0, images - self.pixels, np.nan)

    def points_at(self, state: State) -> Array:
        """Corners in the axes of the first camera, (N, P, 3) in m."""
        if not self.told.plate:
            return state.corners
        return state.r[:, None] + state.size * self.points @ state.R.transpose(0, 2, 1)

    def rows(self, state: State) -> BlockRows:
        """Weighted errors of all images, with those of spacing and of what was given."""
        points = self.points_at(state)
        count, corners = points.shape[:2]
        cameras = len(self.given)
        error = np.zeros((count, corners, cameras, 2))
        by_point = np.zeros((count, corners, cameras, 2, 3))
        by_shared = np.zeros((count, corners, cameras, 2, self.shared))
        lever = points - state.r[:, None] if self.told.plate else points
        for c, camera in enumerate(state.cameras):
            images, slopes = camera.slopes(points)
            weight = (self.seen[c] * self.weights[c])[..., None]
            error[:, :, c] = np.where(
                weight > 0, np.nan_to_num((images - self.pixels[c]) * weight, nan=BEHIND), 0.0
            )
            seen = weight[..., None] * slopes
            by_point[:, :, c] = np.nan_to_num(seen, posinf=0.0, neginf=0.0)
            for name, rows in self._by_camera(c, camera, points, by_point[:, :, c], weight).items():
                by_shared[:, :, c, :, self.columns[name]] = rows
        if self.told.plate:
            across = by_point @ -skewed(lever)[:, :, None]
            by_shared[..., self.columns["size"]] = (by_point @ lever[:, :, None, :, None])[
                ..., :, : int(self.told.sized)
            ]
            by_shared[..., self.columns["turn"]] = across[..., : 3 * self.told.alike]
            own = by_point if self.told.alike else np.concatenate([by_point, across], axis=-1)
        else:
            own = by_point
        blocks = count if self.told.plate else count * corners
        wide = error.size // blocks
        return self._with_the_rest(
            state,
            error.reshape(blocks, wide),
            own.reshape(blocks, wide, own.shape[-1]),
            by_shared.reshape(blocks, wide, self.shared),
        )

    def _by_camera(
        self, c: int, camera: PlacedCamera, points: Array, slopes: Array, weight: Array
    ) -> dict[str, Array]:
        found = {}
        away = points - camera.r
        if c:
            found[f"camera {c}"] = np.concatenate([slopes @ skewed(away), -slopes], axis=-1)
        if self.told.lenses:
            local = away @ camera.R
            x, y = local[..., 0] / local[..., 2], local[..., 1] / local[..., 2]
            s = x * x + y * y
            bent = camera.focal * np.stack([x, y], axis=-1) * s[..., None]
            one, zero = np.ones_like(x), np.zeros_like(x)
            centre = np.stack([one, zero, zero, one], axis=-1).reshape(*x.shape, 2, 2)
            image = (camera.project(points) - camera.centre)[..., None]
            rows = np.concatenate([image, centre, bent[..., None], (bent * s[..., None])[..., None]], axis=-1)
            found[f"lens {c}"] = np.nan_to_num(rows * weight[..., None])
        return found

    def _with_the_rest(self, state: State, error: Array, own: Array, by_shared: Array) -> BlockRows:
        told, lone, slopes = self.told, [], []
        spacing = told.spacing
        if spacing is not None:
            missed, by_place, by_offset = spacing.rows(state.r, state.middles, state.offsets)
            error = np.column_stack([error, missed])
            extra = np.zeros((len(own), 1, own.shape[-1]))
            extra[:, 0, :3] = by_place
            own = np.concatenate([own, extra], axis=1)
            extra = np.zeros((len(own), 1, self.shared))
            extra[:, 0, self.columns["offsets"]] = by_offset
            by_shared = np.concatenate([by_shared, extra], axis=1)
        lost = self.seen.sum(axis=0) == 0
        if not told.plate and lost.any():  # what nothing is known of stays where it is
            error = np.column_stack([error, np.zeros((len(error), 3))])
            held = lost.reshape(-1, 1, 1) * np.eye(3) / FILLED
            own = np.concatenate([own, held], axis=1)
            by_shared = np.concatenate([by_shared, np.zeros((len(own), 3, self.shared))], axis=1)
        if told.lenses:
            for c, (camera, given) in enumerate(zip(state.cameras, self.given, strict=True)):
                rows = np.zeros((LENS, self.shared))
                rows[:, self.columns[f"lens {c}"]] = np.diag(1 / PRIOR)
                slopes.append(rows)
                lone.append((lens_numbers(camera) - lens_numbers(given.placed(camera.r, camera.R))) / PRIOR)
        if not told.plate and len(state.cameras) > 1:  # nothing tells a length: the base keeps its own
            base = state.cameras[1].r
            rows = np.zeros((1, self.shared))
            rows[0, self.columns["camera 1"]] = [0, 0, 0, *(base / (base @ base) / GAUGE)]
            slopes.append(rows)
            lone.append(np.zeros(1))
        none = np.zeros((0, self.shared))
        return BlockRows(
            error, own, by_shared, np.concatenate([np.zeros(0), *lone]), np.vstack([none, *slopes])
        )

    def moved(self, state: State, shared: Array, own: Array) -> State:
        """The state after steps of shared unknowns (S,) and own ones (B, d)."""
        at = {name: shared[where] for name, where in self.columns.items()}
        cameras = []
        for c, camera in enumerate(state.cameras):
            place = at.get(f"camera {c}", np.zeros(PLACE))
            moved = replace(camera, R=turned(camera.R[None], place[None, :3])[0], r=camera.r + place[3:])
            cameras.append(_with_lens(moved, at[f"lens {c}"]) if self.told.lenses else moved)
        if not self.told.plate:
            return replace(
                state, cameras=tuple(cameras), corners=state.corners + own.reshape(state.corners.shape)
            )
        turns = np.broadcast_to(at["turn"], (len(own), 3)) if self.told.alike else own[:, 3:]
        return replace(
            state,
            cameras=tuple(cameras),
            r=state.r + own[:, :3],
            R=turned(state.R, turns),
            size=state.size * (1 + float(at["size"].sum())),
            offsets=state.offsets + at["offsets"],
        )


def lens_numbers(camera: PlacedCamera) -> Array:
    """Logarithm of the focal length, centre, k1, k2: what is estimated of a lens."""
    return np.array([np.log(camera.focal[0]), *camera.centre, *camera.distortion[:2]])


def _with_lens(camera: PlacedCamera, step: Array) -> PlacedCamera:
    bent = np.array(camera.distortion, dtype=float)
    bent[:2] += step[3:]
    return replace(
        camera,
        focal=camera.focal * np.exp(np.clip(step[0], -LONGEST, LONGEST)),
        centre=camera.centre + step[1:3],
        distortion=bent,
    )
