"""``tadcore rare``: what it prints, and what it refuses."""

import json

import pytest

import tadcore
from tadcore.cli import main

STUDY = """
scenario = "game.toml"
trials = 1
seed = 3
[vary]
"attacker.position" = { gaussian = { mean = [3.0, 0.0], std = 0.6 } }
"""


@pytest.fixture
def study(tmp_path):
    game = tadcore.Scenario(
        interaction="I1",
        horizon=0.01,
        step=0.01,
        attacker={"position": [3.0, 0.0], "control_weight": 1e30, "capture_radius": 0.5},
        target={"position": [0.0, 0.0], "control_weight": 1e30},
        defenders=[{"position": [50.0, 50.0], "control_weight": 1e30, "capture_radius": 0.5}],
    )
    (tmp_path / "game.toml").write_text(game.to_toml())
    path = tmp_path / "study.toml"
    path.write_text(STUDY)
    return path


def code_of(*arguments):
    with pytest.raises(SystemExit) as left:
        main([*map(str, arguments)])
    return left.value.code or 0


def test_it_prints_what_python_finds(study, capsys):
    found = tadcore.rare(tadcore.Study.from_toml(study), error=0.2, level=0.9)
    assert code_of("rare", study, "--error", "0.2", "--level", "0.9") == 0
    assert capsys.readouterr().out.splitlines() == found.lines()
    assert code_of("rare", study, "--error", "0.2", "--level", "0.9", "--json") == 0
    assert json.loads(capsys.readouterr().out) == json.loads(json.dumps(found.to_dict()))


def test_it_refuses_by_option(study, capsys):
    assert code_of("rare", study, "--event", "capture") == 2
    assert "--event: got 'capture', must be one of" in capsys.readouterr().err
    assert code_of("rare", study, "--error", "2") == 2
    assert "--error" in capsys.readouterr().err
    assert code_of("rare", study, "--event", "timeout") == 2
    assert "crude runs ended so" in capsys.readouterr().err
