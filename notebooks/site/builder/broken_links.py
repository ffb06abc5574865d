"""Links of built pages that lead nowhere: to no file, to a place that a page has not, or to an empty picture."""

from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

TARGETS = {"a": "href", "link": "href", "img": "src", "script": "src", "source": "src", "iframe": "src"}


class _Page(HTMLParser):
    """The places of a page, and what it links to."""

    def __init__(self, text: str):
        super().__init__()
        self.places = set[str]()
        self.links: list[tuple[str, str]] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {key: value or "" for key, value in attrs}
        self.places |= {values[key] for key in ("id", "name") if key in values}
        wanted = TARGETS.get(tag)
        if wanted in values:
            self.links.append((tag, values[wanted]))


def broken_links(site: Path) -> Iterator[str]:
    """Every broken link within the site, with the page that it stands on. Links to other sites are not followed."""

    @cache
    def page(path: Path) -> _Page:
        return _Page(path.read_text(encoding="utf-8", errors="replace"))

    for path in sorted(site.rglob("*.html")):
        for tag, link in page(path).links:
            wrong = _wrong(site, path, tag, link, page)
            if wrong:
                yield f"{path.relative_to(site)}: {link}: {wrong}"


def _wrong(site: Path, path: Path, tag: str, link: str, page) -> str:
    parts = urlsplit(link)
    if parts.scheme or parts.netloc or link.startswith("data:"):
        return ""
    target = path if not parts.path else (path.parent / unquote(parts.path)).resolve()
    if target.is_dir():
        target /= "index.html"
    if not target.is_relative_to(site.resolve()) and target != path:
        return "leads out of the site"
    if not target.exists():
        return "there is no such file"
    if tag == "img" and target.stat().st_size == 0:
        return "an empty picture"
    place = unquote(parts.fragment)
    if place and target.suffix == ".html" and place not in page(target).places:
        return "the page has no such place"
    return ""
