"""Animations: which frames there are, what they show, and what is written."""

import base64
import io
import re
import shutil
import subprocess

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import animation as movies
from PIL import Image

import tadcore
from tadcore import ScenarioError, plotting
from tadcore.plotting.motion.film import Film
from tadcore.plotting.motion.frames import gif_delays
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


def as_numbers(canvas):
    return np.asarray(canvas.buffer_rgba()).copy()


@pytest.mark.parametrize("name", ["paper-i1", "paper-i2"])
def test_a_picture_is_the_whole_figure_drawn_anew(runs, name):
    """Only what moves is drawn for a picture: not one pixel may differ for it."""
    animation = runs[name].animate(seconds=2.0, fps=15)
    assert any(frame.pause for frame in animation.frames)
    film, whole = Film(Scene(runs[name], 5.0), 80.0), Scene(runs[name], 5.0)
    whole.figure.set_dpi(80.0)
    for frame in animation.frames:
        film.show(frame)
        whole.show(frame)
        whole.figure.canvas.draw()
        np.testing.assert_array_equal(film.pixels, as_numbers(whole.figure.canvas), err_msg=str(frame))


@pytest.mark.parametrize("fps", [0.1, 7, 20, 30, 49, 50, 51, 60, 99.5, 240])
@pytest.mark.parametrize("count", [1, 2, 3, 230, 1000])
def test_delays_of_a_gif_are_played_by_browsers_and_add_up(count, fps):
    delays = gif_delays(count, fps)
    assert min(delays.values()) >= 2
    assert list(delays)[-1] == count - 1, "the end is shown"
    assert sum(delays.values()) == max(round(100 * count / fps), 2)
    if fps <= 50:
        assert list(delays) == list(range(count))
    assert len(delays) >= min(count, int(count * 33 / max(fps, 33)))


def test_a_fast_gif_says_what_it_leaves_out_and_lasts_as_long(run, tmp_path):
    animation = run.animate(seconds=0.5, fps=60, width=3.0)
    with pytest.warns(
        RuntimeWarning, match=rf"at most 50 pictures a second: \d+ of {len(animation.frames)} are written"
    ):
        file = animation.save(tmp_path / "run.gif", dpi=40)
    delays = []
    with Image.open(file) as picture:
        for k in range(picture.n_frames):
            picture.seek(k)
            delays.append(picture.info["duration"])
    assert min(delays) >= 20
    assert sum(delays) / 1000 == pytest.approx(animation.duration, abs=0.01)


def test_flat_colours_of_a_gif_are_exact(run, tmp_path):
    animation = run.animate(seconds=0.5, fps=10, width=4.0)
    film = Film(Scene(run, 4.0), 60.0)
    film.show(animation.frames[0])
    with Image.open(animation.save(tmp_path / "run.gif", dpi=60)) as picture:
        shown = np.asarray(picture.convert("RGB")).astype(int)
    difference = np.abs(shown - film.pixels[..., :3])
    assert (shown[0, 0] == 255).all(), "white is white"
    assert np.mean(difference.max(axis=-1) == 0) > 0.9
    assert difference.max() < 64


def test_no_picture_is_left_out_of_a_large_page(run, tmp_path):
    """Beyond a limit matplotlib leaves out the end."""
    animation = run.animate(seconds=0.5, fps=10, width=4.0)
    with mpl.rc_context({"animation.embed_limit": 0.01, "animation.frame_format": "jpeg"}):
        page = animation.save(tmp_path / "run.html", dpi=60).read_text(encoding="utf-8")
    pictures = re.findall(r'frames\[\d+\] = "data:image/png;base64,([^"]*)"', page)
    assert len(pictures) == len(animation.frames)
    last = Image.open(io.BytesIO(base64.b64decode(pictures[-1].replace("\\\n", ""))))
    film = Film(Scene(run, 4.0), 60.0)
    film.set_size_inches(240 / 60, 138 / 60)  # whole pixels
    film.show(animation.frames[-1])
    np.testing.assert_array_equal(np.asarray(last), film.pixels[..., :3])


@pytest.mark.parametrize("suffix", ["gif", "html"])
def test_ctrl_c_leaves_nothing_behind(run, tmp_path, monkeypatch, suffix):
    taken = []

    def interrupted(self, frame):
        taken.append(frame)
        if len(taken) == 15:
            raise KeyboardInterrupt
        show(self, frame)

    show = Film.show
    monkeypatch.setattr(Film, "show", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run.animate(seconds=0.5, fps=20, width=3.0).save(tmp_path / f"run.{suffix}", dpi=40)
    assert list(tmp_path.iterdir()) == []


def test_progress_is_shown_where_a_terminal_watches(run, tmp_path, monkeypatch, capfd):
    animation = run.animate(seconds=0.5, fps=4, width=3.0)
    animation.save(tmp_path / "run.gif", dpi=40)
    assert capfd.readouterr().err == ""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    animation.save(tmp_path / "run.gif", dpi=40)
    assert "run.gif: 100%" in capfd.readouterr().err


@pytest.mark.parametrize("field", ["seconds", "fps", "width"])
@pytest.mark.parametrize("value", [0, -1, float("nan"), float("inf"), 1e9, "fast", None, True, 1j, [1.0]])
def test_what_no_animation_has_is_refused(run, field, value):
    with pytest.raises(ScenarioError, match=rf"^{field}: got .*, must be a number from"):
        run.animate(**{field: value})


def test_a_notebook_gets_a_player(run):
    html = run.animate(seconds=0.5, fps=2, width=3.0)._repr_html_()
    assert html.count("data:image/png;base64") >= 1
    assert "<script" in html
    assert "base64" in run.animate(seconds=0.5, fps=2, width=3.0).to_gif(dpi=40)


def test_an_encoder_gets_every_pixel(run, tmp_path):
    """A program in the place of ffmpeg that keeps what it is sent; the size of a picture is even in both directions."""
    fake = tmp_path / "ffmpeg"
    fake.write_text('#!/bin/sh\nfor last; do :; done\ncat > "$last"\n', encoding="utf-8")
    fake.chmod(0o755)
    animation = run.animate(seconds=0.5, fps=4, width=3.0)
    with mpl.rc_context({"animation.ffmpeg_path": str(fake)}):
        file = animation.save(tmp_path / "run.mp4", dpi=51)
    film = Film(Scene(run, 3.0), 51.0)
    film.set_size_inches(152 / 51, 88 / 51)
    sent = np.frombuffer(file.read_bytes(), dtype=np.uint8).reshape(len(animation.frames), 88, 152, 4)
    for picture, frame in zip(sent, animation.frames, strict=True):
        film.show(frame)
        np.testing.assert_array_equal(picture, film.pixels)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="no ffmpeg")
def test_mp4_plays_as_long_as_it_says(run, tmp_path):
    animation = run.animate(seconds=0.5, fps=4, width=4.0)
    file = animation.save(tmp_path / "run.mp4", dpi=50)
    asked = ["ffprobe", "-v", "error", "-show_entries", "format=duration", "-of", "csv=p=0", str(file)]
    length = subprocess.run(asked, capture_output=True, text=True, check=True).stdout
    assert float(length) == pytest.approx(animation.duration, abs=0.02)


def test_what_cannot_be_written_says_why(run, tmp_path, monkeypatch):
    animation = run.animate(seconds=0.5, fps=2)
    with pytest.raises(
        ValueError, match=r"path: got '.avi', must be the name of a file that ends in .gif, .mp4, .html"
    ):
        animation.save(tmp_path / "run.avi")
    monkeypatch.setattr(movies.FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    with pytest.raises(RuntimeError, match=r"MP4 needs ffmpeg.*\.gif or \.html"):
        animation.save(tmp_path / "run.mp4")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match=r"fps: got 0, must be a number from 0\.1 to 240"):
        run.animate(fps=0)
    assert isinstance(animation, plotting.Animation)
    assert "frames" in repr(animation)
