"""A run that moves: players with trails and visibility discs, the live network, a clock, and how it ends."""

from __future__ import annotations

import base64
import os
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from tadcore._shared.arrays import as_amount
from tadcore._shared.files import as_path, written
from tadcore._shared.progress import bar
from tadcore.errors import ScenarioError
from tadcore.game.recorded import Recorded
from tadcore.game.sound import until_divergence

from .film import Film
from .frames import Frame, frames_of, gif_delays
from .scene import Scene

if TYPE_CHECKING:
    from matplotlib.animation import AbstractMovieWriter
    from matplotlib.figure import Figure


_SUFFIXES = (".gif", ".mp4", ".html")


class Animation:
    """A run as moving pictures; made by `tadcore.Run.animate`.

    Shown as a player with buttons where it is the last expression of a notebook cell.

    Attributes
    ----------
    run : Run
        What is shown; of a game that diverges, the part before.
    frames : list
        The pictures, in order.
    fps : float
        Pictures in a second, from 0.1 to 240.
    """

    def __init__(self, run: Recorded, *, seconds: float = 8.0, fps: float = 20.0, width: float = 7.2) -> None:
        self.run = until_divergence(run)
        self.fps = _between("fps", fps, 0.1, 240.0)
        self.frames = frames_of(self.run, _between("seconds", seconds, 0.01, 3600.0), self.fps)
        self._width = _between("width", width, 1.0, 40.0)

    @property
    def duration(self) -> float:
        """Length in seconds, pauses included."""
        return len(self.frames) / self.fps

    def figure(self, index: int = -1) -> Figure:
        """One picture as a figure of its own; the last by default."""
        scene = Scene(self.run, self._width)
        scene.show(self.frames[index])
        return scene.figure

    def save(self, path: str | os.PathLike[str], *, dpi: float = 100.0, progress: bool = True) -> Path:
        """Write the animation; the suffix says as what.

        Parameters
        ----------
        path : path
            ``.gif``, ``.mp4`` (which needs ffmpeg) or ``.html`` (one file, pictures inside, however large). It is
            written under a temporary name and then renamed. A GIF shows at most 50 pictures a second, since browsers
            slow down a faster one; of more pictures some are left out, with a warning, and it plays as long.
        dpi : float
            Dots per inch, from 10 to 1,200.
        progress : bool
            Whether to show a progress bar, where standard error is a terminal.

        Returns
        -------
        Path
            The file written.

        Raises
        ------
        ScenarioError
            Another suffix.
        RuntimeError
            MP4 is asked for and ffmpeg is not installed.
        """
        target = as_path("path", path)
        dpi = _between("dpi", dpi, 10.0, 1200.0)
        write = self._writer(target.suffix.lower())
        target.parent.mkdir(parents=True, exist_ok=True)
        film = Film(Scene(self.run, self._width), dpi)
        with written(target) as unfinished:
            write(film, unfinished, dpi, bar(self.frames, target.name, show=progress))
        return target

    def to_jshtml(self, *, dpi: float = 80.0) -> str:
        """Return a page fragment with buttons that plays the animation, pictures inside."""
        with tempfile.TemporaryDirectory() as folder:
            return self.save(Path(folder) / "run.html", dpi=dpi, progress=False).read_text(encoding="utf-8")

    def to_gif(self, *, dpi: float = 80.0) -> str:
        """Return an ``<img>`` element with the animation as a GIF inside."""
        with tempfile.TemporaryDirectory() as folder:
            data = self.save(Path(folder) / "run.gif", dpi=dpi, progress=False).read_bytes()
        alt = str(self.run.diverged or self.run.outcome)
        return f'<img alt="{alt}" src="data:image/gif;base64,{base64.b64encode(data).decode()}">'

    def _repr_html_(self) -> str:
        return self.to_jshtml()

    def _writer(self, suffix: str) -> Callable[[Film, Path, float, Iterable[Frame]], None]:
        from matplotlib import animation

        if suffix == ".gif":
            return self._draw_gif
        if suffix == ".html":
            # The limit is beyond all pages: past it matplotlib would leave out the end.
            page = animation.HTMLWriter(
                fps=self.fps,  # type: ignore[arg-type]
                embed_frames=True,
                default_mode="once",
                embed_limit=1e9,
            )
            page.frame_format = "png"
            return partial(self._draw, page)
        if suffix == ".mp4":
            if not animation.FFMpegWriter.isAvailable():
                raise RuntimeError("an MP4 needs ffmpeg, which is not installed here; save as .gif or .html instead")
            movie = animation.FFMpegWriter(fps=self.fps, codec="h264", extra_args=["-pix_fmt", "yuv420p"])  # type: ignore[arg-type]
            return partial(self._draw, movie)
        raise ScenarioError("path", suffix, f"the name of a file that ends in {', '.join(_SUFFIXES)}")

    def _draw(self, writer: AbstractMovieWriter, film: Film, path: Path, dpi: float, frames: Iterable[Frame]) -> None:
        with writer.saving(cast("Figure", film), str(path), dpi):
            for frame in frames:
                film.show(frame)
                writer.grab_frame()

    def _draw_gif(self, film: Film, path: Path, dpi: float, frames: Iterable[Frame]) -> None:
        delays = gif_delays(len(self.frames), self.fps)
        if len(delays) < len(self.frames):
            skipped = f"{len(delays):,} of {len(self.frames):,} are written, and it plays as long"
            message = f"a GIF shows at most 50 pictures a second: {skipped}; .mp4 and .html have all"
            warnings.warn(message, RuntimeWarning, stacklevel=4)

        colours = self._colours(dpi)

        def pictures() -> Iterator[Image.Image]:
            for index, frame in enumerate(frames):
                if index in delays:
                    film.show(frame)
                    yield film.image().quantize(palette=colours, dither=Image.Dither.NONE)

        every = pictures()
        lasting = [10 * delay for delay in delays.values()]  # Pillow takes milliseconds
        with path.open("wb") as stream:
            next(every).save(stream, format="gif", save_all=True, append_images=every, duration=lasting, loop=0)

    def _colours(self, dpi: float) -> Image.Image:
        """The colours of a GIF: one palette for all pictures, from the first, the last and some of the pauses.

        The most frequent are exact, so that what is white stays white; the others are shades of edges.
        """
        film = Film(Scene(self.run, self._width), dpi)  # one of its own: what has ended stays so
        pauses = list(dict.fromkeys(frame for frame in self.frames if frame.pause))
        sample = []
        for frame in (self.frames[0], *pauses[:: max(len(pauses) // 6, 1)], self.frames[-1]):
            film.show(frame)
            sample.append(film.pixels[..., :3].copy())
        pixels = np.concatenate(sample).reshape(-1, 3) @ np.array([1 << 16, 1 << 8, 1])
        colours, counts = np.unique(pixels, return_counts=True)
        each_once = Image.fromarray(_split(colours)[np.newaxis]).quantize(224).getpalette() or []
        wanted = [
            *_split(colours[np.argsort(-counts, kind="stable")[:64]]).astype(int),
            *np.reshape(each_once, (-1, 3)),
        ]
        # Pillow looks a colour up by its first six bits: what is nearer to these than a flat colour would replace it.
        kept: list[NDArray[np.int64]] = []
        for colour in wanted:
            flat = [(np.square(colour - (f & ~3)).sum(), np.square(f & 3).sum()) for f in kept[:64]]
            if len(kept) < 256 and all(new > own for new, own in flat):
                kept.append(colour)
        palette = Image.new("P", (1, 1))
        palette.putpalette(np.concatenate(kept).tolist())
        return palette

    def __repr__(self) -> str:
        return f"Animation({self.run.diverged or self.run.outcome}; {len(self.frames)} frames, {self.duration:.3g} s)"


def _split(colours: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Red, green and blue of colours that are one number each."""
    return np.stack([colours >> 16, colours >> 8 & 255, colours & 255], axis=-1).astype(np.uint8)


def _between(field: str, value: object, least: float, most: float) -> float:
    rule = f"a number from {least:g} to {most:,.0f}"
    try:
        number = as_amount(field, value)
    except ScenarioError:
        raise ScenarioError(field, value, rule) from None
    if not least <= number <= most:
        raise ScenarioError(field, value, rule)
    return number
