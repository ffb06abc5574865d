"""One page of HTML for any browser, which needs no network: viser's client and what it plays."""

import contextlib
import html
import io
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.viewing.film import Film
from gantrytau.viewing.solids import COLOURS, Solid, extent, ghosts, solids
from gantrytau.whole_files import replacing

SIDES = 24  # of a cone
OTHERS = (
    ".pdf",
    ".png",
    ".svg",
    ".jpg",
    ".jpeg",
    ".gif",
    ".mp4",
    ".webm",
    ".csv",
    ".nc",
    ".json",
)  # files that no page is
GHOST = 0.35  # opacity of where a controller plans to be
AMBIENT = 2.0  # of the light that comes from everywhere, beside that which casts shadows
PARTS = ("bar", "ball", "body", "drive", "ground")  # what turns red at a limit
VIEW = np.array([0.42, -0.62, 0.3])  # of the camera from the middle, in sizes of what is seen


@dataclass(frozen=True, eq=False)
class Page:
    """A page that shows a model; in a notebook it shows itself. text: HTML; file: where it stands, None if nowhere."""

    text: str
    title: str
    file: Path | None = None

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write it to a file and return its path."""
        if Path(path).is_dir():
            raise ModelError(f"{path}: found a folder, expected the name of a file in it, such as robot.html")
        if Path(path).suffix.lower() in OTHERS:
            words = f"{path}: found the suffix of another kind of file, expected .html; buttons of the page save pictures"
            raise ModelError(words, argument="file")
        with replacing(path) as file:
            file.write_text(self.text, encoding="utf-8")
        return Path(path)

    def show(self) -> None:
        """Open it in the browser; it is saved as robot.html if it stands nowhere yet."""
        import webbrowser

        webbrowser.open((self.file or self.save("robot.html")).resolve().as_uri())

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{html.escape(self.text, quote=True)}" style="width:100%;height:480px;border:0"></iframe>'

    def __repr__(self) -> str:
        where = self.file or "not saved"
        return f"<Page {self.title}: {len(self.text) / 1e6:.2f} MB, {where}>"


def page(films: Sequence[Film], names: Sequence[str], title: str) -> str:
    """The HTML of motions beside each other, each under its name."""
    with quiet_server() as server:
        playing = staged(server, films, names)
        serializer = server.get_scene_serializer()
        for k in range(1, max(len(film.times) for film in films)):
            serializer.insert_sleep(max(float(film.step) for film in films))
            for player in playing:
                player.go(k)
        return _titled(serializer.as_html(), title)


def staged(server: Any, films: Sequence[Film], names: Sequence[str]) -> list["Player"]:
    """Motions beside each other on the scene of a server, and the players that move them."""
    scene, playing = server.scene, []
    corners = np.array([extent(film) for film in films])  # (films, 2, 3)
    whole = float(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1).max()) or 1.0
    shifts = np.zeros((len(films), 3))
    widths = np.maximum(corners[:, 1, 0] - corners[:, 0, 0], 0.3 * whole) + 0.25 * whole
    shifts[1:, 0] = np.cumsum((widths[1:] + widths[:-1]) / 2)
    shifts[:, 0] += corners[0].mean(axis=0)[0] - corners.mean(axis=1)[:, 0]
    for film, name, (low, high), shift in zip(films, names, corners, shifts, strict=True):
        parent = f"/{name or film.title or 'model'}".replace(" ", "_")
        scene.add_frame(parent, show_axes=False, position=shift)
        if name:
            above = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, high[2] + 0.12 * whole]
            scene.add_label(f"{parent}/name", name, position=np.array(above))
        scene.add_frame(f"{parent}/world", axes_length=0.06 * whole, axes_radius=0.0025 * whole)
        playing += [Player(scene, f"{parent}/{k}", film, s) for k, s in enumerate(solids(film))]
        for k, solid in enumerate(ghosts(film)):
            playing.append(Player(scene, f"{parent}/plan_{k}", replace(film, bindings=()), solid, GHOST))
    _stage(server, corners + shifts[:, None], whole)
    return playing


def _titled(text: str, title: str) -> str:
    return text.replace("<title>Viser</title>", f"<title>{html.escape(title)}</title>")


def _stage(server: Any, corners: np.ndarray, whole: float) -> None:
    """Light, floor and camera, which sees all of the boxes (films, 2, 3)."""
    scene = server.scene
    scene.set_up_direction("+z")
    scene.configure_environment_map(None)  # it bleaches colours
    scene.add_light_ambient("/light", intensity=AMBIENT)
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    middle, size = (low + high) / 2, float(np.linalg.norm(high - low)) or whole
    cell = float(10.0 ** np.floor(np.log10(whole / 1.5)))
    scene.add_grid(
        "/floor",
        width=3 * size,
        height=3 * size,
        cell_size=cell,
        section_size=5 * cell,
        position=np.array([middle[0], middle[1], low[2] - 0.05 * whole]),
    )
    server.initial_camera.position = middle + VIEW * size
    server.initial_camera.look_at = middle


class Player:
    """A solid on a page, moved from picture to picture where something changes."""

    def __init__(self, scene: Any, name: str, film: Film, solid: Solid, opacity: float | None = None):
        self.handle, self.role = _added(scene, name, solid, opacity), solid.role
        self.shown: list[Any] = [None] * 4
        self.put(film, solid)

    def put(self, film: Film, solid: Solid) -> None:
        """Show this solid of the same kind from here on, at its first picture."""
        from scipy.spatial.transform import Rotation

        self.solid = replace(solid, role=self.role)  # one picture does not tell what stays
        self.q = Rotation.from_matrix(solid.R).as_quat()[:, [3, 0, 1, 2]]
        self.limited = _at_limits(film, solid)
        self.go(0)

    def go(self, k: int) -> None:
        """Show picture k, or the last."""
        if self.solid.kind in ("line", "dots"):
            return
        k = min(k, len(self.q) - 1)
        limit = bool(self.limited[k])
        new = [self.solid.r[k], self.q[k], self.solid.size[k], np.float64(limit)]
        for place, (name, value) in enumerate(zip(("position", "wxyz", "scale", "color"), new, strict=True)):
            old = self.shown[place]
            if old is not None and abs(old - value).max() <= 1e-7:  # np.allclose takes ten times as long
                continue
            self.shown[place] = value
            if name == "color":
                if self.solid.kind not in ("mesh", "axes"):
                    self.handle.color = COLOURS["limit" if limit else self.solid.role]
            elif name == "scale":
                if self.solid.kind == "axes":
                    continue
                self.handle.scale = tuple(np.where(np.abs(value) < 1e-9, 1e-9, value).tolist())
            else:
                setattr(self.handle, name, value)


def _at_limits(film: Film, solid: Solid) -> np.ndarray:
    """Whether something of the component of a solid is at its limit, at each picture; forces keep their colour."""
    found = (
        np.zeros(film.times.size, dtype=bool)
        if film.failed is None or solid.role not in PARTS
        else film.failed.copy()
    )
    for binding in film.bindings if solid.role in PARTS else ():
        component = binding.name.rpartition(".")[0]
        if component and (solid.owner == component or solid.owner.startswith(f"{component}.")):
            found |= (binding.begin <= film.times) & (film.times <= binding.end)
    return found


def _added(scene: Any, name: str, solid: Solid, opacity: float | None = None) -> Any:
    colour: dict[str, Any] = dict(color=COLOURS[solid.role])
    if opacity is not None:
        colour["opacity"] = opacity
    elif (
        solid.kind == "cuboid" and solid.role == "body"
    ) or solid.role == "around":  # what hangs on it is seen through it
        colour["opacity"] = 0.4
    if solid.kind == "cylinder":
        return scene.add_cylinder(name, radius=0.5, height=1.0, **colour)
    if solid.kind == "ball":
        return scene.add_icosphere(name, radius=0.5, **colour)
    if solid.kind == "cuboid":
        return scene.add_box(name, dimensions=(1.0, 1.0, 1.0), **colour)
    if solid.kind == "cone":
        return scene.add_mesh_simple(name, *_cone(), **colour, side="double")
    if solid.kind == "axes":
        long = 0.06 * float(solid.size[0, 0])
        return scene.add_frame(name, axes_length=long, axes_radius=0.05 * long)
    if solid.kind == "dots":
        points, colours = (
            solid.r.astype(np.float32),
            np.tile(np.array(COLOURS[solid.role], dtype=np.uint8), (len(solid.r), 1)),
        )
        return scene.add_point_cloud(name, points, colours, point_size=float(solid.size[0, 0]))
    if solid.kind == "line":
        points = np.stack([solid.r[:-1], solid.r[1:]], axis=1)
        return scene.add_line_segments(
            name, points, COLOURS[solid.role], thickness=3.0, thickness_units="screen"
        )
    mesh = _mesh(solid.file)
    if mesh.visual.kind is None or opacity is not None:  # a file without colours, or seen through
        return scene.add_mesh_simple(name, mesh.vertices, mesh.faces, **colour, flat_shading=True)
    return scene.add_mesh_trimesh(name, mesh)


def _cone() -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a cone of diameter and height 1, its base at the origin."""
    angles = np.arange(SIDES) * 2 * np.pi / SIDES
    ring = 0.5 * np.stack([np.cos(angles), np.sin(angles), np.zeros(SIDES)], axis=1)
    vertices = np.vstack([ring, [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]])
    following = (np.arange(SIDES) + 1) % SIDES
    sides = np.stack([np.arange(SIDES), following, np.full(SIDES, SIDES)], axis=1)
    base = np.stack([following, np.arange(SIDES), np.full(SIDES, SIDES + 1)], axis=1)
    return vertices.astype(np.float32), np.vstack([sides, base]).astype(np.uint32)


def _mesh(file: Path | None) -> Any:
    try:
        import trimesh
    except ImportError:
        raise ModelError(
            f"{file}: found no trimesh, which reads meshes, expected it installed; pip install 'gantrytau[view]'"
        ) from None
    why = "no faces"
    try:
        found = trimesh.load_mesh(str(file))
        if len(getattr(found, "faces", ())):
            return found
    except Exception as error:  # each format has a reader of its own, with errors of its own
        why = f"{type(error).__name__}: {error}"
    raise ModelError(
        f"{file}: found no mesh ({why}), expected a file of STL, OBJ, PLY or GLB; name such a file in MeshFile(file=...)"
    )


@contextlib.contextmanager
def quiet_server() -> Iterator[Any]:
    """A scene of viser. It brings a server along, on a free port of this machine only, which is gone again at once."""
    try:
        import viser
    except ImportError:
        raise ModelError(
            "found no viser, which shows models, expected it installed; pip install 'gantrytau[view]'"
        ) from None
    silence = io.StringIO()
    with contextlib.redirect_stdout(silence):
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(silence):
            server.stop()
