"""What a user gives for a store, as a place."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import Any
from urllib.parse import unquote, urlsplit

from tadcore._shared.files import as_path
from tadcore.errors import ScenarioError

from .folder import Folder
from .place import Place
from .remote import Remote

_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+://")
_COLLAPSED = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:/[^/]")


def as_place(field: str, value: Any, options: Any = None) -> Place:
    """A folder from a path, a remote place from a URL, and a place as it is.

    Raises `ScenarioError` for what cannot name anything, for a service that nothing opens, and for options that are
    given to a folder.
    """
    if isinstance(value, Folder | Remote):
        return value
    if options is not None and not isinstance(options, Mapping):
        rule = "a mapping of options of fsspec, such as {'anon': True}"
        raise ScenarioError("storage_options", type(options).__name__, rule)
    if isinstance(value, str) and _URL.match(value):
        url = urlsplit(value)
        if url.scheme != "file":
            return Remote(value, options).open(field)
        value = unquote(url.path)
    elif isinstance(value, os.PathLike) and _COLLAPSED.match(os.fspath(value)):
        raise ScenarioError(field, os.fspath(value), "a URL as a string: pathlib makes one slash of its two")
    if options is not None:
        names = ", ".join(map(str, options))  # their values may be secrets
        raise ScenarioError("storage_options", names, f"left out: {value} is a folder")
    return Folder(as_path(field, value))
