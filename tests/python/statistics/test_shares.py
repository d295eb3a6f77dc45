"""Probabilities as text: what is uncertain never prints as certain, wherever shares are shown."""

import math
import re

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given, strategies as st

from tadcore import plotting
from tadcore._shared.shares import decimals, estimate, percent, share
from tadcore.cli.app import main
from tadcore.statistics import incidence, paired, probabilities, proportion_interval


def numbers(text):
    return [float(found) for found in re.findall(r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?", text)]


@pytest.mark.parametrize(
    ("count", "trials", "text", "interval"),
    [
        (3, 10**6, "0.0000030", "[0.0000010, 0.0000088]"),
        (999_997, 10**6, "0.9999970", "[0.9999912, 0.9999990]"),
        (0, 10**6, "0.0000000", "[0.0000000, 0.0000038]"),
        (10**6, 10**6, "1.0000000", "[0.9999962, 1.0000000]"),
        (27, 40, "0.6750", "[0.5202, 0.7992]"),
        (500_000, 10**6, "0.5000", "[0.4990, 0.5010]"),
    ],
)
def test_digits_follow_the_width_of_the_interval(count, trials, text, interval):
    low, high = (float(end) for end in proportion_interval(count, trials))
    assert estimate(count / trials, low, high) == (text, interval)


@given(
    trials=st.integers(1, 2**40),
    share_of=st.one_of(st.just(0.0), st.just(1.0), st.floats(0, 1), st.floats(1e-12, 1e-6).map(lambda x: 1 - x)),
    method=st.sampled_from(["wilson", "exact", "sequence"]),
    level=st.sampled_from([0.5, 0.95, 0.999999]),
)
def test_nothing_uncertain_prints_as_certain(trials, share_of, method, level):
    count = min(round(share_of * trials), trials)
    low, high = (float(end) for end in proportion_interval(count, trials, level=level, method=method))
    p = count / trials
    text, interval = estimate(p, low, high)
    said = [numbers(text)[0], *numbers(interval)]
    assert 0.0 <= low <= p <= high <= 1.0
    for value, shown in zip((p, low, high), said, strict=True):
        assert (shown == 0.0) == (value == 0.0)
        assert (shown == 1.0) == (value == 1.0)
        assert shown == pytest.approx(value, abs=max(high - low, 1e-16) / 10, rel=0.06)
    assert (said[1] < said[0]) == (low < p)
    assert (said[0] < said[2]) == (p < high)


@given(st.floats(-1, 1), st.integers(0, 8))
def test_signs_and_limits(value, places):
    text = share(value, places, sign=True)
    assert text[0] in "+-"
    assert (float(text) == 0.0) == (value == 0.0)
    assert (abs(float(text)) == 1.0) == (abs(value) == 1.0)


def test_what_is_no_number_is_no_digit():
    assert estimate(math.nan, math.nan, math.nan) == ("–", "[–, –]")
    assert decimals(0.0, math.inf) == decimals(0.3, 0.3) == decimals(math.nan, 1.0) == 4


@pytest.mark.parametrize(
    ("level", "text"),
    [
        (0.95, "95 %"),
        (0.999, "99.9 %"),
        (1 - 1e-9, "99.9999999 %"),
        (1 - 2**-53, "99.99999999999999 %"),
        (1e-9, "1e-07 %"),
    ],
)
def test_no_level_is_a_hundred_percent(level, text):
    assert percent(level) == text


M = 10**6
KIND = np.zeros(M, dtype=np.int8)
KIND[:3], KIND[3] = 2, 1
DEFENDER = np.where(KIND == 2, 0, -1).astype(np.int32)


def test_tables_of_rare_outcomes():
    text = repr(probabilities(KIND, DEFENDER, 1))
    rows = {row.split()[0]: row for row in text.splitlines()[2:]}
    assert "0.0000030" in rows["intercepted"]
    assert "[0.0000010, 0.0000088]" in rows["intercepted"]
    assert "0.999996" in rows["timeout"]
    assert "1.0000]" not in text

    other = KIND.copy()
    other[2] = 0
    found = paired(KIND, DEFENDER, other, np.where(other == 2, 0, -1), 1)
    row = next(row for row in repr(found).splitlines() if row.startswith("intercepted"))
    assert "+0.0000010" in row
    assert "0.0000 " not in row

    curves = incidence(KIND, DEFENDER, np.ones(M), horizon=1.0, step=0.5, n=1)
    said = repr(curves)
    assert "intercepted 3.0e-06" in said
    assert "timeout 0.999996" in said


def test_a_figure_labels_rare_outcomes():
    mpl.use("Agg")
    ax = plotting.outcome_probabilities(probabilities(KIND, DEFENDER, 1))
    texts = [text.get_text() for text in ax.texts]
    assert "0.0000030" in texts
    assert not {"0.000", "1.000"} & {
        text for text, p in zip(texts, probabilities(KIND, DEFENDER, 1).estimate, strict=True) if 0 < p < 1
    }


def test_the_command_of_maps_shows_single_places(tmp_path, capsys):
    """One defender's capture disc is a few places of many."""
    with pytest.raises(SystemExit):
        main(
            [
                "map",
                "paper-i1",
                "--out",
                str(tmp_path / "m.nc"),
                "--size",
                "120",
                "--x",
                "-40",
                "40",
                "--y",
                "-40",
                "40",
            ]
        )
    lines = capsys.readouterr().out.splitlines()
    for line in lines[1:4]:
        _, count, shown = line.split()
        total = int(lines[0].split()[0].replace(",", ""))
        assert (float(shown) == 0.0) == (int(count.replace(",", "")) == 0)
        assert float(shown) == pytest.approx(int(count.replace(",", "")) / total, abs=1e-4)
