"""Robots in SDF, written for tests."""

from pathlib import Path

INERTIA = "<mass>{0}</mass><inertia><ixx>.01</ixx><iyy>.02</iyy><izz>.025</izz><ixy>.001</ixy></inertia>"
ACROSS = "<axis><xyz>0 -1 0</xyz></axis>"


def written(folder: Path, body: str, around: str = "{}") -> Path:
    """An SDF file with a model of that content."""
    file = folder / "robot.sdf"
    model = around.format(f'<model name="robot">{body}</model>')
    file.write_text(f'<?xml version="1.0"?>\n<sdf version="1.10">{model}</sdf>\n')
    return file


def link(name: str, pose: str = "<pose/>", m: float = 1.0, more: str = "") -> str:
    """A link with its centre of mass aside."""
    inertial = f"<inertial><pose>.2 0 0.01 0.3 0 0</pose>{INERTIA.format(m)}</inertial>"
    return f'<link name="{name}">{pose}{inertial}{more}</link>'


def joint(name: str, kind: str, parent: str, child: str, inside: str = ACROSS) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent>{parent}</parent><child>{child}</child>{inside}</joint>'
    )


def bar(name: str, x: float, z: float, pitch: float) -> str:
    """A link in the plane y = 0."""
    return link(name, f"<pose>{x} 0 {z} 0 {pitch} 0</pose>")


SERIAL = (
    link("one", "<pose>0 0 1 0.1 0.2 0.3</pose>", 2.0)
    + link("two", '<pose relative_to="one">0.3 0.1 0 0 0 0.5</pose>')
    + link("three", '<pose relative_to="tool" degrees="true">0 0 0.1 0 90 0</pose>', 0.5)
    + '<frame name="tool" attached_to="two"><pose>0 0 .2 0 0 1</pose></frame>'
    + joint(
        "p",
        "revolute",
        "world",
        "one",
        "<pose>0 0 .05 0.2 0 0</pose><axis><xyz expressed_in='__model__'>0 1 1</xyz></axis>",
    )
    + joint("s", "prismatic", "one", "two", "<axis><xyz>1 0 1</xyz></axis>")
    + joint(
        "q",
        "continuous",
        "tool",
        "three",
        '<pose relative_to="tool">.1 0 0 0 1 0</pose><axis><xyz>0 0.3 1</xyz></axis>',
    )
)

# crank 0.3 m up, rocker 0.6 m; the coupler leads from the crank's end to the rocker's
FOUR_BAR = (
    bar("crank", 0.0, 0.0, -1.5707963267948966)
    + bar("coupler", 0.0, 0.3, -0.3)
    + bar("rocker", 1.0, 0.0, -1.2)
    + joint("turn", "revolute", "world", "crank")
    + joint("pin", "revolute", "crank", "coupler")
    + joint("swing", "revolute", "world", "rocker")
    + joint("close", "revolute", "rocker", "coupler", f"<pose>0.9 0 0 0 0 0</pose>{ACROSS}")
)
HUNG = link("bob") + joint("ball", "ball", "world", "bob", "<pose>-.3 0 .1 0 0 0</pose>")
CROSS = "<axis><xyz>1 0 0</xyz></axis><axis2><xyz>0 1 0</xyz></axis2>"
GIMBAL = link("bob") + joint("cross", "universal", "world", "bob", f"<pose>-.3 0 .1 0 0 0</pose>{CROSS}")
FREE = (
    link("base", "<pose>0 0 1 0.3 0.2 0.1</pose>") + link("arm") + joint("elbow", "revolute", "base", "arm")
)
