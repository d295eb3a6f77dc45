"""The README's blocks run, and its commands exist."""

import re
from pathlib import Path

import matplotlib as mpl
import pytest

from tadcore.cli.app import app

README = Path(__file__).parents[3] / "README.md"


def test_python_blocks_run_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    mpl.use("Agg")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert len(blocks) >= 2
    namespace: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, str(README), "exec"), namespace)
    printed = capsys.readouterr().out
    assert "d1 intercepts the attacker at t = 1.395" in printed
    assert re.search(r"^1,000 trials$.*^intercepted +\d+ ", printed, flags=re.MULTILINE | re.DOTALL)
    assert all((tmp_path / name).stat().st_size > 10_000 for name in ("run.png", "shares.png"))
    assert (tmp_path / "attackers" / "part-0000000000-0000001000.parquet").is_file()


def test_commands_and_pictures_exist() -> None:
    text = README.read_text(encoding="utf-8")
    commands = {command.name or command.callback.__name__ for command in app.registered_commands if command.callback}
    assert set(re.findall(r"`tadcore ([\w-]+)", text)) == commands
    makefile = (README.parent / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"^make (\w+)", text, flags=re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target
    for picture in re.findall(r"!\[.*?\]\((.*?)\)", text):
        assert (README.parent / picture).is_file(), picture
