"""A run that moves: players with trails and visibility discs, the live network, a clock, and how it ends."""

from __future__ import annotations

import base64
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tadcore._shared.files import written
from tadcore.game.recorded import Recorded

from .frames import frames_of
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
        What is shown.
    frames : list
        The pictures, in order.
    fps : float
        Pictures in a second.
    """

    def __init__(self, run: Recorded, *, seconds: float = 8.0, fps: float = 20.0, width: float = 7.2) -> None:
        for name, value in (("seconds", seconds), ("fps", fps), ("width", width)):
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name}: got {value!r}, must be a positive number")
        self.run = run
        self.fps = float(fps)
        self.frames = frames_of(run, seconds, self.fps)
        self._width = float(width)

    @property
    def duration(self) -> float:
        """Length in seconds, pauses included."""
        return len(self.frames) / self.fps

    def figure(self, index: int = -1) -> Figure:
        """One picture as a figure of its own; the last by default."""
        scene = Scene(self.run, self._width)
        scene.show(self.frames[index])
        return scene.figure

    def save(self, path: str | os.PathLike[str], *, dpi: float = 100.0) -> Path:
        """Write the animation; the suffix says as what.

        Parameters
        ----------
        path : path
            ``.gif``, ``.mp4`` (which needs ffmpeg) or ``.html`` (one file, pictures inside). It is written under a
            temporary name and then renamed.
        dpi : float
            Dots per inch.

        Returns
        -------
        Path
            The file written.

        Raises
        ------
        ValueError
            Another suffix.
        RuntimeError
            MP4 is asked for and ffmpeg is not installed.
        """
        target = Path(path)
        writer = self._writer(target.suffix.lower())
        target.parent.mkdir(parents=True, exist_ok=True)
        with written(target) as partial:
            self._draw(writer, partial, dpi)
        return target

    def to_jshtml(self, *, dpi: float = 80.0) -> str:
        """Return a page fragment with buttons that plays the animation, pictures inside."""
        with tempfile.TemporaryDirectory() as folder:
            return self.save(Path(folder) / "run.html", dpi=dpi).read_text(encoding="utf-8")

    def to_gif(self, *, dpi: float = 80.0) -> str:
        """Return an ``<img>`` element with the animation as a GIF inside."""
        with tempfile.TemporaryDirectory() as folder:
            data = self.save(Path(folder) / "run.gif", dpi=dpi).read_bytes()
        alt = str(self.run.outcome)
        return f'<img alt="{alt}" src="data:image/gif;base64,{base64.b64encode(data).decode()}">'

    def _repr_html_(self) -> str:
        return self.to_jshtml()

    def _writer(self, suffix: str) -> AbstractMovieWriter:
        from matplotlib import animation

        if suffix == ".gif":
            return animation.PillowWriter(fps=self.fps)  # type: ignore[arg-type]
        if suffix == ".html":
            return animation.HTMLWriter(fps=self.fps, embed_frames=True, default_mode="once")  # type: ignore[arg-type]
        if suffix == ".mp4":
            if not animation.FFMpegWriter.isAvailable():
                raise RuntimeError("an MP4 needs ffmpeg, which is not installed here; save as .gif or .html instead")
            return animation.FFMpegWriter(fps=self.fps, codec="h264", extra_args=["-pix_fmt", "yuv420p"])  # type: ignore[arg-type]
        raise ValueError(f"path: got the suffix {suffix!r}, must be one of {', '.join(_SUFFIXES)}")

    def _draw(self, writer: AbstractMovieWriter, path: Path, dpi: float) -> None:
        scene = Scene(self.run, self._width)
        with writer.saving(scene.figure, str(path), dpi):
            for frame in self.frames:
                scene.show(frame)
                writer.grab_frame()

    def __repr__(self) -> str:
        return f"Animation({self.run.outcome}; {len(self.frames)} frames, {self.duration:.3g} s)"
