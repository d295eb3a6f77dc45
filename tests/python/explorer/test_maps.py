"""The maps behind the explorer's plane: they are what the batch and the certificate say, made beside the page."""

import re
import time

import numpy as np
import pytest

import tadcore

pytest.importorskip("bokeh")

from tadcore import _core
from tadcore.explorer import Explorer, Page
from tadcore.explorer.painting import SIDE, UNDECIDED, UNKNOWN, proved, sampled

REGION = (-3.0, 2.0, -2.0, 3.0)
FULL = tadcore.scenarios.load("paper-i1-full").replace({"step": 0.02})


class Desk:
    """What a document does for a page: it calls what other threads ask for, one after the other."""

    def __init__(self):
        self.asked = []

    def add_next_tick_callback(self, action):
        self.asked.append(action)

    def add_timeout_callback(self, action, milliseconds):
        return action

    def remove_timeout_callback(self, action):
        pass

    def wait(self, until):
        for _ in range(1200):
            while self.asked:
                self.asked.pop(0)()
            if until():
                return
            time.sleep(0.05)
        raise AssertionError("nothing came in a minute")


def middles(region):
    left, right, bottom, top = region
    inside = (np.arange(SIDE) + 0.5) / SIDE
    return left + (right - left) * inside, bottom + (top - bottom) * inside


def _middle_ends():
    half = 2.5 / SIDE
    return [(REGION[0] + half, REGION[1] - half), (REGION[2] + half, REGION[3] - half)]


def played(sc, player, places):
    """The code of the outcome from each place, by `simulate_batch`."""
    starts = np.repeat(sc.positions[None], len(places), axis=0)
    starts[:, sc.players.index(player)] = places
    batch = tadcore.simulate_batch(sc, starts)
    assert not batch.diverged.any()
    return np.where(batch.kind == 2, 2 + batch.defender, batch.kind)


@pytest.mark.parametrize("player", ["attacker", "d2"])
def test_a_sampled_map_is_what_games_from_its_pixels_say(player):
    pictures = list(sampled(FULL, player, REGION, _core.Stop()))
    assert [picture.share for picture in pictures] == [0.0] * 16 + [(i + 1) / 16 for i in range(16)]
    assert [(picture.codes == UNKNOWN).mean() for picture in pictures] == [1 - (i + 1) / 16 for i in range(16)] + [
        0
    ] * 16
    whole = tadcore.outcome_map(
        FULL, player, **{axis: (*ends, SIDE) for axis, ends in zip("xy", _middle_ends(), strict=True)}
    )
    kind, defender = whole.dataset["kind"].values, whole.dataset["defender"].values
    assert (np.where(kind == 2, 2 + defender, kind) != pictures[-1].codes).mean() < 1e-3, "but for rounding of places"
    rows, columns = np.random.default_rng(3).integers(0, SIDE, (2, 300))
    x, y = middles(REGION)
    np.testing.assert_array_equal(
        pictures[-1].codes[rows, columns], played(FULL, player, np.column_stack([x[columns], y[rows]]))
    )
    assert len(pictures[-1].there) > 2
    coarse = (np.arange(0, SIDE, 4) + 2) / SIDE
    first = played(FULL, player, np.column_stack([-3.0 + 5.0 * coarse, np.full(SIDE // 4, -2.0 + 5.0 * coarse[9])]))
    np.testing.assert_array_equal(pictures[15].codes[36], np.repeat(first, 4))


def test_a_proved_map_is_what_the_certificate_says():
    *_, last = proved(FULL, "attacker", REGION, _core.Stop())
    found = tadcore.certified_map(FULL, x=REGION[:2], y=REGION[2:], resolution=0.9 * 5.0 / SIDE)
    x, y = middles(REGION)
    kind, defender = found.at(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    said = np.where(kind < 0, UNDECIDED, np.where(kind == 2, 2 + defender, kind)).reshape(SIDE, SIDE)
    np.testing.assert_array_equal(last.codes, said)
    assert last.share == 1.0
    assert 0.8 < (last.codes >= 0).mean() < 1.0
    *_, other = sampled(FULL, "attacker", REGION, _core.Stop())
    sure = last.codes >= 0
    np.testing.assert_array_equal(last.codes[sure], other.codes[sure])
    colours = last.rgba(1.0, ("#404040", 0.5)).view(np.uint8).reshape(SIDE, SIDE, 4)
    assert (colours[~sure] == [64, 64, 64, 128]).all()
    nothing = type(last)(0.0, np.full((1, 1), UNKNOWN), last.names)
    assert nothing.rgba(1.0, ("#404040", 0.5)).tolist() == [[0]]


@pytest.fixture
def shown():
    page, desk = Page(Explorer(FULL)), Desk()
    page.attach(desk)
    yield page, desk
    page.close()


def test_a_map_stays_while_its_player_moves_and_goes_when_another_does(shown):
    page, desk = shown
    backdrop, source = page.backdrop, page.backdrop.sources["sampled"]
    backdrop.switches["sampled"].active = True
    desk.wait(lambda: len(source.data["image"]) and "%" not in backdrop.said.text)
    left, right, bottom, top = page.feed.region
    assert [source.data[name] for name in ("x", "y", "dw", "dh")] == [[left], [bottom], [right - left], [top - bottom]]
    assert "captured" in backdrop.said.text
    there = source.data["image"][0]
    page.press("ArrowLeft", True)
    page.pause()
    assert source.data["image"][0] is there
    page.radii.zeta["d1"][1].active = False
    assert len(source.data["image"]) == 0, "another game has another map"
    desk.wait(lambda: len(source.data["image"]) and "%" not in backdrop.said.text)
    page.chosen.value = "d1"
    assert len(source.data["image"]) == 0
    backdrop.switches["sampled"].active = False
    assert backdrop.said.text == ""
    page.drag(0.0, 0.0)
    time.sleep(0.2)
    desk.wait(lambda: not desk.asked)
    assert len(source.data["image"]) == 0, "what was under way is not shown any more"


def test_both_maps_lie_over_one_another(shown):
    page, desk = shown
    for switch in page.backdrop.switches.values():
        switch.active = True
    desk.wait(lambda: re.search(r"proved: \d\d\.\d % of the area$", page.backdrop.said.text))
    assert [len(source.data["image"]) for source in page.backdrop.sources.values()] == [1, 1]


def test_what_has_no_map_says_why(shown):
    page, desk = shown
    page.explorer.put("sensing", {"mean_time_to_failure": 1.0})
    for switch in page.backdrop.switches.values():
        switch.active = True
    desk.wait(lambda: page.backdrop.said.text.count("must be") == 2)
    assert "one without failures and disturbances for an outcome map" in page.backdrop.said.text
    assert "the proof covers sight alone" in page.backdrop.said.text


def test_a_map_in_space_is_over_x_and_y():
    sc = FULL.replace({name: (*at, 0.1) for name, at in _places(FULL).items()})
    page, desk = Page(Explorer(sc)), Desk()
    page.attach(desk)
    page.planes.active = 1
    page.backdrop.switches["sampled"].active = True
    assert "choose the plane xy" in page.backdrop.said.text
    page.planes.active = 0
    desk.wait(lambda: len(page.backdrop.sources["sampled"].data["image"]))
    page.close()


def _places(sc):
    paths = [*(f"defenders.{i}" for i in range(sc.n)), "target", "attacker"]
    return {f"{path}.position": tuple(at) for path, at in zip(paths, sc.positions.tolist(), strict=True)}


def test_a_closed_page_stops_what_it_makes():
    page, desk = Page(Explorer(tadcore.scenarios.load("paper-i1"))), Desk()
    page.attach(desk)
    page.backdrop.switches["proved"].active = True
    desk.wait(lambda: len(page.backdrop.sources["proved"].data["image"]))
    (work,) = page.backdrop._work.values()
    begin = time.monotonic()
    page.close()
    work.join()
    assert time.monotonic() - begin < 5.0, "the whole map takes minutes"


def test_a_map_of_a_large_team_is_stopped_within_its_first_strip():
    sc = tadcore.scenarios.load("paper-i1")
    one = sc.defenders[0].model_dump(exclude_unset=True)
    places = np.random.default_rng(1).uniform(-2, 2, (9, 2)).round(2)
    crowd = sc.replace(
        {"defenders": [{**one, "position": tuple(at), "visibility_radius": 2.0} for at in places.tolist()]}
    )
    page, desk = Page(Explorer(crowd)), Desk()
    page.attach(desk)
    page.backdrop.switches["sampled"].active = True
    (work,) = page.backdrop._work.values()
    time.sleep(1.0)
    assert work._thread.is_alive(), "a strip takes longer"
    begin = time.monotonic()
    page.backdrop.switches["sampled"].active = False
    work.join()
    assert time.monotonic() - begin < 5.0
    assert len(page.backdrop.sources["sampled"].data["image"]) == 0
    page.close()
