"""The gallery: a picture of each component that has an example, by the parts of `gallery.toml`."""

from collections.abc import Iterable, Iterator, Mapping

from notebooks.site.builder.gallery.drawn_examples import Drawn, picture_options
from notebooks.site.builder.reading.task_groups import page_of

OPENING = """# Gallery

What models and components look like, or what they do. Each picture is drawn by the example that stands with it in the
reference, when this site is built.
"""


def gallery_page(drawn: Mapping[str, Drawn]) -> str:
    """The page in Markdown."""
    text = OPENING
    for part in dict.fromkeys(one.example.part for one in drawn.values()):
        cards = _cards(one for one in drawn.values() if one.example.part == part)
        text += f"\n## {part}\n\n:::::{{container}} gallery\n" + "\n\n".join(cards) + "\n:::::\n"
    return text


def _cards(drawn: Iterable[Drawn]) -> Iterator[str]:
    """A figure for each picture, below it the components that it is of."""
    alike: dict[bytes, list[Drawn]] = {}
    for one in drawn:
        alike.setdefault(one.picture.read_bytes(), []).append(one)
    for several in alike.values():
        first = several[0].example.full
        target = f"../reference/{page_of(first)}.html#{first}"
        names = " ".join(f"{{py:obj}}`{one.example.name} <{one.example.full}>`" for one in several)
        options = picture_options(several[0], target)
        yield f"::::{{figure}} {first}.png\n{options}\n\n{names}\n::::"
