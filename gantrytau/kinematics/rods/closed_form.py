"""Three links in closed form, many poses at once; guideways need be neither parallel nor unit vectors.

    |offset_i + q_i direction_i - r| = L_i                      Dressler (2012), (4.9)

Arrays much longer than the cache make NumPy wait for memory, so the work goes block by block.
"""

import numpy as np

BLOCK = 4096  # poses: nine rows of them are 288 KiB, which stays in the second cache


class InverseOfThreeLinks:
    """Positions of three carts for positions of the tool; offset, direction (3, 3), a row an arm; length (3,) in m."""

    def __init__(self, offset: np.ndarray, direction: np.ndarray, length: np.ndarray):
        size = np.linalg.norm(direction, axis=1)
        # along each guideway, and across it in two directions, all in units of the actuator coordinate
        across = np.linalg.svd(direction[:, None, :])[2][:, 1:]
        axes = (
            np.concatenate([direction[None], np.swapaxes(across, 0, 1) * size[:, None]]) / size[:, None] ** 2
        )
        self._axes = np.ascontiguousarray(axes.reshape(9, 3))
        self._shift = np.einsum("kij,ij->ki", axes, offset).reshape(9, 1)
        self._squares = ((length / size) ** 2)[:, None]

    def __call__(self, r: np.ndarray, sides: np.ndarray) -> np.ndarray:
        """Positions q (N, 3) in m for r (N, 3); NaN rows out of reach. sides (3,): 1 with the tool ahead of its cart."""
        q = np.empty((len(r), 3))
        sides = np.asarray(sides, dtype=float)[:, None]
        ahead = bool((sides == 1.0).all())
        with np.errstate(invalid="ignore"):
            for first in range(0, len(r), BLOCK):
                part = slice(first, first + BLOCK)
                places = self._axes @ r[part].T
                places -= self._shift
                along, y, z = places[:3], places[3:6], places[6:]
                y *= y
                z *= z
                y += z
                np.subtract(self._squares, y, out=z)
                least = z.min()
                np.sqrt(z, out=z)
                if not ahead:
                    z *= sides
                np.subtract(along, z, out=q[part].T)
                if not least >= 0.0:  # NaN as well
                    q[part][np.isnan(q[part]).any(axis=1)] = np.nan
        return q


def meeting(centres: np.ndarray, length: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where three spheres meet: foot (N, 3), height (N, 3), margin (N,); the points are foot +- height.

    centres: (N, 3, 3), a row a sphere, m; length: (3,) radii, m. height is along the normal of the plane through the
    centres, first to second cross first to third; it is zero and margin, its square in m2, negative where they do not
    meet. Centres in one line give NaN.
    """
    foot, height, margin = np.empty((len(centres), 3)), np.empty((len(centres), 3)), np.empty(len(centres))
    with np.errstate(invalid="ignore", divide="ignore"):
        for first in range(0, len(centres), BLOCK):
            part = slice(first, first + BLOCK)
            c = np.ascontiguousarray(centres[part].transpose(1, 2, 0))
            foot[part].T[:], height[part].T[:], margin[part] = _spheres(c, length)
    return foot, height, margin


def forward_of_three_links(
    offset: np.ndarray, direction: np.ndarray, length: np.ndarray, q: np.ndarray, side: float | np.ndarray
) -> np.ndarray:
    """The tool (N, 3) in m for cart positions q (N, 3); NaN rows where links do not meet.

    side: 1 for the tool on that side of the plane of the carts to which the guideways point, -1 for the other; or points
    (N, 3), of which the tool is the nearer.
    """
    r = np.empty((len(q), 3))
    upwards = direction.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        for first in range(0, len(q), BLOCK):
            part = slice(first, first + BLOCK)
            centres = offset[:, :, None] + direction[:, :, None] * np.ascontiguousarray(q[part].T)[:, None]
            foot, height, margin = _spheres(centres, length)
            wanted = side[part].T - foot if isinstance(side, np.ndarray) else side * upwards[:, None]
            height *= np.where(dot_of_columns(height, wanted) < 0, -1.0, 1.0)
            height[:, ~(margin >= 0.0)] = np.nan
            np.add(foot, height, out=r[part].T)
    return r


def slopes_of_three_links(
    offset: np.ndarray, direction: np.ndarray, r: np.ndarray, q: np.ndarray
) -> np.ndarray:
    """dq/dr (N, 3, 3): a link l keeps its length, l.(dr - v dq) = 0."""
    found = np.empty((len(r), 3, 3))
    with np.errstate(invalid="ignore", divide="ignore"):
        for first in range(0, len(r), BLOCK):
            part = slice(first, first + BLOCK)
            place, along = np.ascontiguousarray(r[part].T), np.ascontiguousarray(q[part].T)
            for i in range(3):
                link = place - offset[i, :, None] - direction[i, :, None] * along[i]
                link /= dot_of_columns(link, direction[i])
                found[part, i] = link.T
    return found


def _spheres(c: np.ndarray, length: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What `meeting` answers, the pose last: foot and height (3, N), margin (N,) of centres (3, 3, N)."""
    d, e = c[1] - c[0], c[2] - c[0]
    normal = cross_of_columns(d, e)
    area = dot_of_columns(normal, normal)
    # the foot lies on the planes in which two spheres meet
    along_d = (dot_of_columns(d, d) + (length[0] ** 2 - length[1] ** 2)) / 2
    along_e = (dot_of_columns(e, e) + (length[0] ** 2 - length[2] ** 2)) / 2
    across = (along_d * cross_of_columns(e, normal) + along_e * cross_of_columns(normal, d)) / area
    square = length[0] ** 2 - dot_of_columns(across, across)
    return c[0] + across, np.sqrt(np.maximum(square, 0.0) / area) * normal, square


def dot_of_columns(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A . b of vectors (3, N)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross_of_columns(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """A x b of vectors (3, N)."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
