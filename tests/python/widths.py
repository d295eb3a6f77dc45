"""Fresh interpreters on a chosen width of vector registers."""

import os
import subprocess
import sys


def python(code, simd, *arguments):
    """A fresh interpreter in which the variable says this, or is not there."""
    environment = {name: value for name, value in os.environ.items() if name != "TADCORE_SIMD"}
    if simd is not None:
        environment["TADCORE_SIMD"] = simd
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


def widths():
    """What this processor has, by what the refusal of a wrong word says."""
    refused = python("from tadcore import _core; _core.simd()", "none").stderr
    return refused.strip().rsplit("this processor has ", 1)[1].split(", ")
