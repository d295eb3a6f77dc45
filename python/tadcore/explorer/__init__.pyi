from .model import Explorer
from .page import Page
from .server import serve

__all__ = ["Explorer", "Page", "serve"]
