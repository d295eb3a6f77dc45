"""What a user gives for a store, as a place."""

from __future__ import annotations

from typing import Any

from tadcore._shared.files import as_path

from .folder import Folder
from .place import Place


def as_place(field: str, value: Any) -> Place:
    """A folder from a path, and a place as it is; raises `ScenarioError` for what cannot name anything."""
    return value if isinstance(value, Folder) else Folder(as_path(field, value))
