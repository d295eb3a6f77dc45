"""What every file carries: who wrote it, and from which scenario."""

from __future__ import annotations

import hashlib

from tadcore import _core

from .model import Scenario


def provenance(sc: Scenario) -> dict[str, str]:
    """What every file carries: who wrote it, and from which scenario."""
    text = sc.to_toml()
    return {
        "tadcore_version": _core.__version__,
        "scenario_sha256": hashlib.sha256(text.encode()).hexdigest(),
        "scenario": text,
    }
