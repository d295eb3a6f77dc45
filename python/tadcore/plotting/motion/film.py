"""Pictures of a scene, one after another: what stands still is drawn once, what moves is drawn over it.

A picture is the same, pixel for pixel, as the whole figure drawn anew: over the background come all artists that lie
above the lowest that moves, in the order in which matplotlib draws them.
"""

from __future__ import annotations

from typing import IO, Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from .frames import Frame
from .scene import Scene


class Film:
    """The pictures of a scene at some dots per inch; stands for a figure where matplotlib's writers ask for one."""

    def __init__(self, scene: Scene, dpi: float) -> None:
        self._scene = scene
        self._figure = scene.figure
        self._figure.set_dpi(dpi)
        self._canvas: Any = self._figure.canvas
        self._frame: Frame | None = None
        self._still: object = None
        self._background: Any = None
        self._files: dict[str, bytes] = {}

    def show(self, frame: Frame) -> None:
        """Draw a frame, unless it is the one that is shown."""
        if frame == self._frame:
            return
        self._files.clear()
        self._scene.show(frame)
        self._frame = frame
        if self._scene.space:
            self._canvas.draw()
            return
        front = self._scene.front()
        if self._background is None or self._scene.still != self._still:
            self._still = self._scene.still
            for artist in front:
                artist.set_animated(True)
            self._canvas.draw()
            self._background = self._canvas.copy_from_bbox(self._figure.bbox)
        self._canvas.restore_region(self._background)
        for artist in front:
            artist.draw(self._canvas.get_renderer())

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """What is shown, of shape (height, width, 4)."""
        return np.asarray(self._canvas.buffer_rgba())

    def image(self) -> Image.Image:
        """What is shown, in a picture of its own."""
        return Image.fromarray(self.pixels[..., :3].copy())

    def get_size_inches(self) -> NDArray[np.float64]:
        """As of a figure."""
        return np.asarray(self._figure.get_size_inches())

    def set_size_inches(self, width: float, height: float, forward: bool = True) -> None:
        """As of a figure."""
        if (width, height) != tuple(self.get_size_inches()):
            self._figure.set_size_inches(width, height, forward)
            self._frame = self._background = None

    def savefig(self, stream: IO[bytes], *, format: str, **_: object) -> None:
        """As of a figure: what is shown, as bare pixels or as a PNG."""
        if format not in self._files:
            if format == "png":
                self._files[format] = self._as_png()
            else:
                self._files[format] = self.pixels.tobytes()
        stream.write(self._files[format])

    def _as_png(self) -> bytes:
        import io

        stream = io.BytesIO()
        self.image().save(stream, format="png")
        return stream.getvalue()
