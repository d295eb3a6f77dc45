"""Figures of runs and of studies, as the field prints them.

Every function draws in the axes it is given, or in new ones, and returns them; none changes a global setting. Figures
are legible at one column (3.5 in) and across two (7.16 in), to a colour-blind reader and in greyscale. A figure's
module, and Matplotlib with it, is loaded when the figure is first asked for.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
