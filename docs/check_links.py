"""Follow every link of the built pages that stays inside them; used by ``make docs``, needs no network.

Usage: ``python docs/check_links.py docs/_build/html``. Prints what leads nowhere and exits with 1 if anything does.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit


class Page(HTMLParser):
    """The anchors and the links of one page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note ids, and what ``href`` and ``src`` point to."""
        for name, value in attrs:
            if value and name in ("id", "name"):
                self.anchors.add(value)
            elif value and name in ("href", "src"):
                self.links.add(value)


def _pages(root: Path) -> list[Path]:
    """Return the pages; files that came with the theme are not ours to check."""
    return [file for file in sorted(root.rglob("*.html")) if "_static" not in file.relative_to(root).parts]


def broken(root: Path) -> list[str]:
    """Return a line for each link that leads to no file or no anchor."""
    pages = {file.resolve(): Page(file.read_text(encoding="utf-8")) for file in _pages(root)}
    lines = []
    for file, page in pages.items():
        for link in sorted(page.links):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            path, anchor = urldefrag(link)
            target = (file.parent / unquote(path.partition("?")[0])).resolve() if path else file
            target = target / "index.html" if target.is_dir() else target
            if not target.is_file():
                lines.append(f"{file.relative_to(root.resolve())}: no file for {link}")
            elif anchor and target in pages and unquote(anchor) not in pages[target].anchors:
                lines.append(f"{file.relative_to(root.resolve())}: no anchor for {link}")
    return lines


def main() -> int:
    """Check the folder named on the command line; one without pages was not built."""
    root = Path(sys.argv[1])
    found = broken(root) if _pages(root) else [f"{root}: no pages"]
    print("\n".join(found) or "every local link leads somewhere")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
