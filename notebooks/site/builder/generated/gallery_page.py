"""The gallery: a picture of each component that has an example, by the parts of `gallery.toml`."""

from collections.abc import Mapping

from notebooks.site.builder.gallery.drawn_examples import Drawn
from notebooks.site.builder.reading.task_groups import page_of

OPENING = """# Gallery

What models and components look like, or what they do. Each picture is drawn by the example that stands with it in the
reference, when this site is built.
"""


def gallery_page(drawn: Mapping[str, Drawn]) -> str:
    """The page in Markdown."""
    text = OPENING
    for part in dict.fromkeys(one.example.part for one in drawn.values()):
        cards = [_card(one) for one in drawn.values() if one.example.part == part]
        text += f"\n## {part}\n\n:::::{{container}} gallery\n" + "\n\n".join(cards) + "\n:::::\n"
    return text


def picture(drawn: Drawn, target: str = "") -> list[str]:
    """The options of a picture; target: the page that it leads to."""
    options = [f":alt: {drawn.example.alt}", ":loading: lazy"]
    options += [":class: scene"] if drawn.scene else []
    return options + ([f":target: {target}"] if target else [])


def _card(one: Drawn) -> str:
    name = one.example.full
    target = f"../reference/{page_of(name)}.html#{name}"
    return "\n".join(
        [
            f"::::{{figure}} {name}.png",
            *picture(one, target),
            "",
            f"{{py:obj}}`{one.example.name} <{name}>`",
            "::::",
        ]
    )
