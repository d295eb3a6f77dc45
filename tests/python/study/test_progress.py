"""Progress: the rate of the last minute, and lines in a log."""

import re

import numpy as np
import pytest

from tadcore.study.progress import Progress


@pytest.fixture
def clock(monkeypatch):
    """A clock that a test sets."""
    now = [0.0]
    monkeypatch.setattr("tadcore.study.progress.time.monotonic", lambda: now[0])
    return now


def some(trials):
    return np.array([trials // 2, 0, trials - trials // 2, 0, 0])


def test_a_log_has_a_line_a_minute_with_the_rate_of_the_last(clock, capsys):
    with Progress(1_000_000, wanted="my study") as progress:
        for second in range(1, 241):
            clock[0] = float(second)
            progress.add(some(100 if second <= 120 else 2000))
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    found = [
        re.search(r"^my study: ([\d,]+) of 1,000,000 trials, ([\d:]+) left, ([\d.]+k?)/s, ", line) for line in lines
    ]
    assert [match[3] for match in found] == ["100", "162", "2.00k"]  # (59 · 100 + 2 · 2000) / 61
    done = int(found[2][1].replace(",", ""))
    minutes, seconds = map(int, found[2][2].split(":"))
    assert 60 * minutes + seconds == (1_000_000 - done) // 2000
    assert lines[0].endswith("intercepted 0.500 captured 0.000 timeout 0.500")


def test_what_a_store_holds_is_no_speed(clock, capsys):
    with Progress(10_000, wanted=True) as progress:
        clock[0] = 1.0
        progress.add(some(5000), stored=True)
        for second in (31, 62):
            clock[0] = float(second)
            progress.add(some(30))
    assert "5,060 of 10,000 trials" in (line := capsys.readouterr().err)
    assert re.search(r", 0?\.?98\d?/s|, 0\.984/s|, 0\.98/s", line), line


def test_nobody_asked(clock, capsys):
    with Progress(10, wanted=False) as progress:
        clock[0] = 1e6
        progress.add(some(10))
    assert capsys.readouterr().err == ""
