"""Follow every link of a folder of HTML pages: dead ones, and what a page would load from elsewhere."""

from __future__ import annotations

import re
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# Addresses that a style sheet loads.
OUTSIDE = re.compile(r"(?:url\(|@import)\s*[\"']?((?:https?:)?//[^\"')]+)")
# What a page loads, in contrast to what a reader may go to.
LOADING = {"link", "script", "img", "iframe", "source", "video", "audio", "embed", "object"}
ADDRESSES = {"href", "src", "data"}


class Page(HTMLParser):
    """The links of a page, and what links may point to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[tuple[str, str]] = []
        self.anchors: set[str] = {"", "top"}
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if value is None:
                continue
            if name == "id" or (tag == "a" and name == "name"):
                self.anchors.add(value)
            if name in ADDRESSES and not value.startswith("data:"):
                self.links.append((tag, value))


@cache
def page_of(path: Path) -> Page:
    return Page(path.read_text(encoding="utf-8"))


def faults(site: Path) -> list[str]:
    """Return a sentence for each fault of the pages and style sheets in a folder."""
    found = []
    for path in sorted(site.rglob("*.html")):
        name = path.relative_to(site)
        for tag, address in page_of(path).links:
            found += [f"{name}: {fault}" for fault in faults_of(path, tag, address)]
    for path in sorted(site.rglob("*.css")):
        outside = OUTSIDE.findall(path.read_text(encoding="utf-8"))
        found += [f"{path.relative_to(site)}: loads {address}" for address in outside]
    return found


def faults_of(path: Path, tag: str, address: str) -> list[str]:
    parts = urlsplit(address)
    if parts.scheme in {"http", "https"} or address.startswith("//"):
        return [f"<{tag}> loads {address}"] if tag in LOADING else []
    if parts.scheme:
        return []
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if target.is_dir():
        target /= "index.html"
    if not target.exists():
        return [f"{address} is not there"]
    written = {parts.fragment, unquote(parts.fragment)}  # as browsers look for it
    if parts.fragment and target.suffix == ".html" and not written & page_of(target).anchors:
        return [f"{address}: no such place in the page"]
    return []
