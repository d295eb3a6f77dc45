from .desk import Desk as Desk
from .model import Explorer as Explorer
from .page import Page as Page
from .server import serve as serve
