"""The explorer: a local page on which one drags players and radii and sees the game at once.

Started by ``tadcore explore``. It needs Bokeh (the extra ``explore``). A game in space
is shown in projection along one of its axes.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
