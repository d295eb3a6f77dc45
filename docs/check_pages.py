"""Read the built pages as a reader would; used by ``make docs``, needs no network.

Every link that stays inside leads somewhere; no cell prints a warning, writes to standard error, or names a path of the
machine that built it; figures are wide enough, and sharp on a display of two pixels for each of theirs.

Usage: ``python docs/check_pages.py docs/_build/html``. Prints what is wrong and exits with 1 if anything is.
"""

import re
import struct
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag, urlsplit

LEAST_WIDTH = 640  # pixels of a figure as it is shown, where the page is as wide
SHARP = 2  # of its own for each of them
HERE = str(Path(__file__).resolve().parents[1])
MACHINE = re.compile(r"(?<![\w.:/-])/(?:home|root|tmp|usr|var|Users|private)/[\w.-]+")


class Page(HTMLParser):
    """The anchors and the links of one page, what its cells print, and the figures that they draw."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.errors: list[str] = []
        self.printed: list[str] = []
        self.figures: dict[str, str] = {}
        self._inside: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note ids, what ``href`` and ``src`` point to, and where the outputs of cells begin."""
        given = {name: value or "" for name, value in attrs}
        for name, value in given.items():
            if value and name in ("id", "name"):
                self.anchors.add(value)
            elif value and name in ("href", "src"):
                self.links.add(value)
        if tag == "img" and any("cell_output" in kind for kind in self._inside):
            self.figures[given.get("src", "")] = given.get("style", "") + given.get("width", "")
        if tag == "div":
            self._inside.append(given.get("class", ""))

    def handle_endtag(self, tag: str) -> None:
        """Note where they end."""
        if tag == "div" and self._inside:
            self._inside.pop()

    def handle_data(self, data: str) -> None:
        """Keep what cells print, standard error apart."""
        if not data.strip():
            return
        if any("stderr" in kind.split() for kind in self._inside):
            self.errors.append(data)
        elif any("cell_output" in kind for kind in self._inside):
            self.printed.append(data)


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


def blemishes(root: Path) -> list[str]:
    """Return a line for whatever a cell should not have printed, and for each figure too narrow or too coarse."""
    lines = []
    for file in _pages(root):
        page, name = Page(file.read_text(encoding="utf-8")), file.relative_to(root)
        lines += [f"{name}: on standard error: {text.strip()[:90]}" for text in page.errors]
        for text in page.printed:
            found = [HERE] if HERE in text else MACHINE.findall(text)
            lines += [f"{name}: a path of this machine: {path}" for path in found]
            if "Warning:" in text:
                lines.append(f"{name}: a warning: {text.strip()[:90]}")
        for source, style in page.figures.items():
            image = file.parent / unquote(source)
            if image.suffix != ".png" or not image.is_file():
                continue
            wide = struct.unpack(">I", image.read_bytes()[16:20])[0]
            shown = re.search(r"width: ?(\d+)px", style)
            if wide < SHARP * (int(shown[1]) if shown else LEAST_WIDTH) or (shown and int(shown[1]) < LEAST_WIDTH):
                lines.append(
                    f"{name}: {source} has {wide} pixels, shown {shown[1] if shown else 'as wide as they are'}"
                )
    return lines


def main() -> int:
    """Check the folder named on the command line; one without pages was not built."""
    root = Path(sys.argv[1])
    found = [*broken(root), *blemishes(root)] if _pages(root) else [f"{root}: no pages"]
    print("\n".join(found) or "every local link leads somewhere, and no cell prints what it should not")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
