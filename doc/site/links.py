"""Follow every link of the built site that stays in it: to a file, and to a place in a page."""

from __future__ import annotations

from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class _Page(HTMLParser):
    """The links of a page, and the places in it to which a link may lead."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.places: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        for name, value in attributes:
            if name in ('href', 'src') and value:
                self.links.add(value)
            elif name == 'id' and value:
                self.places.add(value)


@cache
def _page(path: Path) -> _Page:
    return _Page(path.read_text('utf-8'))


def broken(site: Path) -> list[str]:
    """Every link of the site that leads nowhere, or away from it to a file of this machine."""
    found = []
    for path in sorted(site.rglob('*.html')):
        for link in sorted(_page(path).links):
            fault = _fault(site, path, link)
            if fault:
                found.append(f'{path.relative_to(site)}: {link}: {fault}')
    return found


def _fault(site: Path, path: Path, link: str) -> str:
    parts = urlsplit(link)
    if parts.scheme in ('http', 'https', 'mailto', 'data'):
        return ''
    if parts.scheme or parts.netloc or parts.path.startswith('/'):
        return 'not a place of this site'
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if not target.is_relative_to(site.resolve()) or not target.is_file():
        return 'no such file'
    if parts.fragment and target.suffix == '.html':
        if unquote(parts.fragment) not in _page(target).places:
            return 'no such place in the page'
    return ''
