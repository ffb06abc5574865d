"""terminalsAndIcons of FMI 3.0, and the icon of an FMU, drawn here: two rails, carts, and links that carry a plate.

FMI 3.0.2, section 2.4.9. The icon is terminalsAndIcons/icon.png (and .svg) in FMI 3 and model.png in FMI 2.
"""

import struct
import zlib
from functools import cache

import numpy as np

from gantrytau_fmu.describing.xml_text import HEAD, element, parent
from gantrytau_fmu.description import FmuDescription, FmuTerminal

SIZE = 64  # pixels of the icon, each way
RAIL, LINK, CART, PLATE = (110, 118, 129), (31, 78, 121), (60, 60, 60), (217, 119, 6)
# strokes with round ends, painted in this order: start and end (x to the right, y down, of 1), width, colour
STROKES = (
    ((0.08, 0.16), (0.92, 0.16), 0.05, RAIL),
    ((0.08, 0.84), (0.92, 0.84), 0.05, RAIL),
    ((0.24, 0.16), (0.56, 0.50), 0.06, LINK),
    ((0.74, 0.16), (0.56, 0.50), 0.06, LINK),
    ((0.34, 0.84), (0.56, 0.50), 0.06, LINK),
    ((0.19, 0.16), (0.29, 0.16), 0.14, CART),
    ((0.69, 0.16), (0.79, 0.16), 0.14, CART),
    ((0.29, 0.84), (0.39, 0.84), 0.14, CART),
    ((0.50, 0.50), (0.62, 0.50), 0.20, PLATE),
)
CONNECTABLE = ("input", "output", "parameter")  # what may be a member of a terminal


def terminals_and_icons(fmu: FmuDescription) -> bytes:
    """terminalsAndIcons/terminalsAndIcons.xml of FMI 3.0: where the icon stands, and the terminals.

    Members are inputs, outputs and parameters; others of a component are left out, and terminals without members.
    A bus may be connected to another of which only some members agree.
    """
    corners = {"x1": -100.0, "y1": -100.0, "x2": 100.0, "y2": 100.0}
    graphics = [
        element("CoordinateSystem", corners | {"suggestedScalingFactorTo_mm": 0.1}),
        element("Icon", corners),
    ]
    terminals = [_terminal(fmu, terminal) for terminal in fmu.terminals]
    children = [parent("GraphicalRepresentation", graphics), parent("Terminals", terminals)]
    return (HEAD + parent("fmiTerminalsAndIcons", children, {"fmiVersion": "3.0"})).encode()


def _terminal(fmu: FmuDescription, terminal: FmuTerminal) -> str:
    members = [
        element(
            "TerminalMemberVariable",
            {"variableName": variable.name, "memberName": member, "variableKind": "signal"},
        )
        for member, name in terminal.members.items()
        if (variable := fmu.by_name[name]).causality in CONNECTABLE
    ]
    attributes = {"name": terminal.name, "matchingRule": "bus", "terminalKind": terminal.kind or None}
    return parent("Terminal", members, attributes | {"description": terminal.description or None})


@cache
def icon() -> bytes:
    """The icon as PNG with transparent ground, SIZE x SIZE pixels."""
    middles = (np.arange(SIZE) + 0.5) / SIZE
    points = np.stack(np.meshgrid(middles, middles), axis=-1)
    colour, opacity = np.zeros((SIZE, SIZE, 3)), np.zeros((SIZE, SIZE, 1))
    for start, end, width, paint in STROKES:
        along = np.subtract(end, start)
        part = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
        distance = np.linalg.norm(points - (np.array(start) + part[..., None] * along), axis=-1)
        cover = np.clip((width / 2 - distance) * SIZE + 0.5, 0.0, 1.0)[..., None]
        whole = cover + opacity * (1 - cover)
        colour = (np.array(paint) * cover + colour * opacity * (1 - cover)) / np.where(whole > 0, whole, 1.0)
        opacity = whole
    pixels = np.concatenate([colour, 255 * opacity], axis=-1).round().astype(np.uint8)
    lines = b"".join(b"\0" + line.tobytes() for line in pixels)
    header = struct.pack(">IIBBBBB", SIZE, SIZE, 8, 6, 0, 0, 0)  # 8 bits each of red, green, blue, opacity
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines, 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


def icon_svg() -> bytes:
    """The same icon as SVG."""
    lines = "".join(
        element(
            "line",
            {"x1": start[0], "y1": start[1], "x2": end[0], "y2": end[1]}
            | {"stroke-width": width, "stroke": "#{:02x}{:02x}{:02x}".format(*paint)},
        )
        for start, end, width, paint in STROKES
    )
    frame = {"xmlns": "http://www.w3.org/2000/svg", "viewBox": "0 0 1 1", "stroke-linecap": "round"}
    return (HEAD + parent("svg", [lines], frame)).encode()
