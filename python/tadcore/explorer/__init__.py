"""The explorer: a local page on which one drags players and radii and sees the game at once.

Started by ``tadcore explore``. It needs Bokeh (the extra ``explore``). A game in space
is shown in projection along one of its axes.
"""

from .model import Explorer
from .page import Page
from .server import serve

__all__ = ["Explorer", "Page", "serve"]
