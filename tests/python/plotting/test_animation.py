"""Animations: which frames there are, what they show, and what is written."""

import shutil
import subprocess

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import animation as movies
from PIL import Image

import tadcore
from tadcore import plotting
from tadcore.plotting.motion.scene import Scene
from tadcore.plotting.run.network import _NEW

FRAMES_IN_A_PAUSE = 4  # 0.4 s at 10 pictures a second


@pytest.fixture(scope="module")
def run(runs):
    return runs["paper-i1"]


def lines_by_marker(figure):
    return {line.get_marker(): line for line in figure.axes[0].lines if line.get_marker() not in ("None", "", None)}


def test_frames_pause_at_every_change_and_on_the_end(run):
    animation = run.animate(seconds=2.0, fps=10)
    pauses = [frame.k for frame in animation.frames if frame.pause]
    when = [change.time for change in run.network_changes[1:]]
    assert run.times[pauses[::FRAMES_IN_A_PAUSE]] == pytest.approx(when)
    assert len(pauses) == FRAMES_IN_A_PAUSE * len(when)
    over = [frame for frame in animation.frames if frame.over]
    assert len(over) == 16
    assert animation.frames[-1].k == len(run.times) - 1
    instants = [frame.k for frame in animation.frames]
    assert instants == sorted(instants)
    assert animation.duration == pytest.approx(len(animation.frames) / 10)


def test_a_restless_network_does_not_stop_the_clock():
    places = np.random.default_rng(3).uniform(-2, 2, (5, 2)).tolist()
    names = [*(f"defenders[{i}].position" for i in range(3)), "target.position", "attacker.position"]
    run = tadcore.simulate(tadcore.scenarios.load("paper-i1").replace(dict(zip(names, places, strict=True))))
    assert len(run.network_changes) > 80
    animation = run.animate(seconds=2.0, fps=10)
    assert animation.duration < 2.0 + 1.6 + 4.1


def test_a_frame_shows_where_everyone_is(run):
    scene = Scene(run, 5.0)
    animation = run.animate(seconds=1.0, fps=10)
    for frame in (animation.frames[0], next(f for f in animation.frames if f.pause), animation.frames[-1]):
        scene.show(frame)
        markers = lines_by_marker(scene.figure)
        assert len(markers) == 5
        shown = np.array([line.get_xydata()[0] for line in markers.values()])
        np.testing.assert_allclose(shown, run.position[frame.k])
        texts = [text.get_text() for text in scene.figure.texts]
        assert texts[0] == f"t = {run.times[frame.k]:.3f}"
        thick = [p for p in scene.figure.axes[1].patches if p.get_linewidth() == _NEW["linewidth"]]
        assert len(thick) == (1 if frame.pause else 0)
    assert texts[1] == "$d_{1}$ intercepts $a$ at $t=1.395$"
    scene.show(animation.frames[-1])
    assert scene.figure.texts[1].get_text() == texts[1], "the end stays on the screen"


def test_visibility_discs_have_their_radius(run):
    figure = run.animate(seconds=0.5, fps=4).figure(0)
    fields = [patch.get_xy() for patch in figure.axes[0].patches]
    assert len(fields) == 3
    for field, centre, radius in zip(fields, run.position[0], run.scenario.visibility_radii, strict=False):
        assert np.linalg.norm(field - centre, axis=1) == pytest.approx(radius)


def test_a_game_in_space_moves_in_space():
    data = tadcore.scenarios.load("paper-i1").model_dump()
    for height, part in enumerate((*data["defenders"], data["target"], data["attacker"])):
        part["position"] = (*part["position"], 0.2 * height)
    run = tadcore.simulate(tadcore.Scenario.model_validate(data))
    figure = run.animate(seconds=0.5, fps=4).figure()
    assert figure.axes[0].name == "3d"
    figure.canvas.draw()
    ends = [np.array(line.get_data_3d())[:, 0] for line in lines_by_marker(figure).values()]
    np.testing.assert_allclose(ends, run.position[-1])


def test_gif_has_every_frame(run, tmp_path):
    animation = run.animate(seconds=0.5, fps=4, width=4.0)
    before = dict(mpl.rcParams)
    file = animation.save(tmp_path / "new" / "run.gif", dpi=50)
    assert dict(mpl.rcParams) == before
    with Image.open(file) as picture:
        assert picture.size == (200, 116)
        assert picture.info["duration"] == 250
        seconds = 0
        for k in range(picture.n_frames):  # equal neighbours are stored as one longer frame
            picture.seek(k)
            seconds += picture.info["duration"] / 1000
    assert seconds == pytest.approx(animation.duration)
    assert [f.name for f in file.parent.iterdir()] == ["run.gif"]


def test_a_notebook_gets_a_player(run):
    html = run.animate(seconds=0.5, fps=2, width=3.0)._repr_html_()
    assert html.count("data:image/png;base64") >= 1
    assert "<script" in html
    assert "base64" in run.animate(seconds=0.5, fps=2, width=3.0).to_gif(dpi=40)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg")
def test_mp4_plays_as_long_as_it_says(run, tmp_path):
    animation = run.animate(seconds=0.5, fps=4, width=4.0)
    file = animation.save(tmp_path / "run.mp4", dpi=50)
    asked = ["ffprobe", "-v", "error", "-show_entries", "format=duration", "-of", "csv=p=0", str(file)]
    length = subprocess.run(asked, capture_output=True, text=True, check=True).stdout
    assert float(length) == pytest.approx(animation.duration, abs=0.02)


def test_what_cannot_be_written_says_why(run, tmp_path, monkeypatch):
    animation = run.animate(seconds=0.5, fps=2)
    with pytest.raises(ValueError, match=r"suffix '.avi', must be one of .gif, .mp4, .html"):
        animation.save(tmp_path / "run.avi")
    monkeypatch.setattr(movies.FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(RuntimeError, match=r"MP4 needs ffmpeg.*\.gif or \.html"):
        animation.save(tmp_path / "run.mp4")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="fps: got 0, must be a positive number"):
        run.animate(fps=0)
    assert isinstance(animation, plotting.Animation)
    assert "frames" in repr(animation)
