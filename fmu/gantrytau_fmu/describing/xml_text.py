"""Elements of XML as text: escaped, one line each, numbers that read back to the same bits.

XML 1.0, section 2.2 (characters); IEEE 754: the shortest decimal that rounds back, as Python's repr gives it.
"""

import re
from collections.abc import Iterable, Mapping

HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
# what XML cannot hold (controls, surrogates, non-characters), and the controls that it only tolerates
REFUSED = re.compile("[^\x20-\x7e\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
SPACE = re.compile(r"\s+")
ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"})

Attribute = str | int | float | bool | None


def plain(text: str) -> str:
    """A text on one line, without characters that XML does not allow."""
    if text.isascii() and text.isprintable():
        return text.strip()
    return REFUSED.sub("", SPACE.sub(" ", text)).strip()


def literal(value: str | int | float | bool) -> str:
    """A value as the schemas write it: true, 3, 0.1, or the text, escaped."""
    if isinstance(value, str):
        return plain(value).translate(ESCAPES)
    if isinstance(value, bool):
        return "true" if value else "false"
    return (
        repr(float(value)) if isinstance(value, float) else repr(int(value))
    )  # without numpy's names of types


def element(tag: str, attributes: Mapping[str, Attribute], inner: str = "") -> str:
    """`<tag name="value">inner</tag>` and a new line; attributes that are None are left out."""
    told = "".join([f' {name}="{literal(value)}"' for name, value in attributes.items() if value is not None])
    return f"<{tag}{told}>{inner}</{tag}>\n" if inner else f"<{tag}{told}/>\n"


def parent(tag: str, children: Iterable[str], attributes: Mapping[str, Attribute] | None = None) -> str:
    """An element around others, each on lines of its own; nothing if there are none."""
    inside = "".join(children)
    return element(tag, attributes or {}, "\n" + inside) if inside else ""
