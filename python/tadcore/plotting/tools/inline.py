"""A figure as part of a page: a picture within its HTML, drawn for no display."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from html import escape
from typing import Any

from .axes import for_files, root_figure
from .style import style

_DPI = 220
_CSS_DPI = 110  # how large a page shows it: sharp on screens of two dots a pixel


def inline(draw: Callable[[], Any], words: str) -> str:
    """An ``img`` of what is drawn; ``words`` say what it shows where it cannot be seen."""
    with for_files(), style():
        figure = root_figure(draw())
        stream = io.BytesIO()
        figure.savefig(stream, format="png", dpi=_DPI)
    width = round(figure.get_size_inches()[0] * _CSS_DPI)
    data = base64.b64encode(stream.getvalue()).decode()
    return f'<img width="{width}" alt="{escape(words)}" src="data:image/png;base64,{data}">'
