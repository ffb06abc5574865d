"""An XML file with the path of each of its elements, and numbers and words of elements, checked."""

import math
import os
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

from gantrytau.border.refusal import ModelError, did_you_mean


@dataclass(frozen=True)
class XmlFile:
    """A file by its outermost element; `paths` as `robot/joint[elbow]/axis`, from one element to the next."""

    file: str
    top: Element
    paths: dict[Element, str]

    @staticmethod
    def read(file: str | os.PathLike[str], kind: str, tag: str = "", inside: str = "") -> "XmlFile":
        """The file, in whose outermost element `tag`, if one is expected, something is `inside`; ModelError for others."""
        path = Path(file)
        try:
            text = path.read_bytes()
            top = ElementTree.fromstring(text)
        except OSError as error:
            raise _refused(path, f"no file that can be read ({error.strerror})", kind) from None
        except (ElementTree.ParseError, ValueError, LookupError) as error:
            raise _refused(path, f"no XML ({error})", kind) from None
        if b"xacro:" in text:
            way = f"{kind}; write it with `xacro {path.name} > robot{path.suffix}`"
            raise _refused(path, "macros of xacro", way)
        if tag and top.tag != tag:
            raise _refused(path, f"<{top.tag}>", f"<{tag}> around {inside}")
        return XmlFile(str(path), top, _paths(top, top.tag))

    def again(self) -> "XmlFile":
        """The same after elements have come in."""
        return XmlFile(self.file, self.top, _paths(self.top, self.top.tag))

    def refusal(self, part: Element | None, found: str, expected: str) -> ModelError:
        """Error for a fault in an element."""
        place = self.file if part is None or part is self.top else f"{self.file}: {self.paths[part]}"
        return _refused(place, found, expected)

    def one(self, part: Element, tag: str) -> Element:
        """An element in another that has to be there."""
        found = part.find(tag)
        if found is None:
            raise self.refusal(part, f"no <{tag}>", "one")
        return found

    def word(self, part: Element, key: str) -> str:
        """An attribute that has to be there."""
        found = (part.get(key) or "").strip()
        if not found:
            raise self.refusal(part, f"<{part.tag}> without {key}=", f'{key}="..."')
        return found

    def number(self, part: Element | None, key: str, otherwise: float | None = None) -> float:
        """An attribute as a finite number; `otherwise` where it is not there, if that is allowed."""
        if otherwise is not None and (part is None or part.get(key) is None):
            return otherwise
        assert part is not None  # without `otherwise` it was found
        return self.numbers(part, key, 1)[0]

    def numbers(
        self, part: Element | None, key: str, count: int, otherwise: tuple[float, ...] | None = None
    ) -> tuple[float, ...]:
        """An attribute as so many finite numbers; `otherwise` where it is not there, if that is allowed."""
        if otherwise is not None and (part is None or part.get(key) is None):
            return otherwise
        assert part is not None
        return self.read_numbers(part, self.word(part, key), count, f'{key}="{part.get(key)}"')

    def read_numbers(
        self, part: Element, text: str, count: int, shown: str, finite: bool = True
    ) -> tuple[float, ...]:
        """A text as so many numbers, finite ones unless infinity is allowed."""
        try:
            found = tuple(float(word) for word in text.split())
        except ValueError:
            found = ()
        if len(found) != count or any(math.isnan(x) or (finite and math.isinf(x)) for x in found):
            many = "a finite number" if count == 1 else f"{count} finite numbers"
            raise self.refusal(part, shown, many)
        return found

    def known(self, part: Element, what: str, name: str, names: Iterable[str], kind: str) -> str:
        """A name that is one of `names`."""
        if name not in (some := list(names)):
            raise self.refusal(part, f"{what} '{name}'", f"a {kind} that is there{did_you_mean(name, some)}")
        return name

    def different(self, kind: str, names: Iterable[str]) -> None:
        """ModelError for two of one name."""
        twice = [name for name, times in Counter(names).items() if times > 1]
        if twice:
            raise self.refusal(None, f"two {kind} of the name '{min(twice)}'", "different names")


def _paths(part: Element, path: str) -> dict[Element, str]:
    """The paths of an element and of all that are in it: by their names, or by their numbers where several have none."""
    found, times = {part: path}, Counter(child.tag for child in part)
    seen: Counter[str] = Counter()
    for child in part:
        mark = child.get("name") or (str(seen[child.tag]) if times[child.tag] > 1 else "")
        seen[child.tag] += 1
        found |= _paths(child, f"{path}/{child.tag}{f'[{mark}]' if mark else ''}")
    return found


def _refused(place: str | os.PathLike[str], found: str, expected: str) -> ModelError:
    return ModelError(f"{place}: found {found}, expected {expected}", argument="file")
