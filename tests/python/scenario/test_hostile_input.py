"""What a stranger may put in the place of a file, a name or an entry: a clear error, at once, and a clean terminal."""

import contextlib
import os
import socket
import time

import numpy as np
import pytest

import tadcore
from study_cases import calm, part, resealed, study
from tadcore import Scenario, ScenarioError, StoreError
from tadcore._shared.toml import parse_toml
from tadcore.cli.app import main
from tadcore.sampling import Box, Choice

TEXT = tadcore.scenarios.load("paper-i1").to_toml()


def put(path, kind):
    """Something else in the place of a file; the name that an error gives it."""
    path.unlink(missing_ok=True)
    if kind == "a pipe":
        os.mkfifo(path)
    elif kind == "a folder":
        path.mkdir()
    elif kind == "a device":
        path.symlink_to("/dev/zero")
    else:
        here = os.open(".", os.O_RDONLY)
        os.chdir(path.parent)  # names of sockets are short
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(path.name)
        os.fchdir(here)
        os.close(here)


KINDS = pytest.mark.parametrize("kind", ["a pipe", "a folder", "a device", "a socket"])


@KINDS
@pytest.mark.parametrize("read", [Scenario.from_toml, tadcore.Study.from_toml])
def test_what_is_no_file_is_refused_before_it_is_opened(tmp_path, kind, read):
    """A pipe without a writer would be waited for, a device read for ever."""
    put(tmp_path / "given.toml", kind)
    with pytest.raises(ScenarioError, match=rf"given\.toml: got '{kind}', must be a file"):
        read(tmp_path / "given.toml")


@KINDS
@pytest.mark.parametrize("name", ["_manifest.json", part(0, 300)])
def test_what_is_no_file_is_refused_in_a_store(tmp_path, kind, name):
    folder = tmp_path / "store"
    study(300).run(store=folder)
    put(folder / name, kind)
    for use in (tadcore.load_study, lambda folder: study(300).run(store=folder)):
        with pytest.raises(StoreError, match=f"it is {kind}, not a file") as caught:
            use(folder)
        assert caught.value.path == str(folder / name)


@KINDS
def test_what_is_no_lock_is_refused_in_a_store(tmp_path, kind):
    folder = tmp_path / "store"
    whole = study(300).run(store=folder)
    put(folder / "_store.lock", kind)
    words = "it is a link" if kind == "a device" else f"it is {kind}, not a file"
    with pytest.raises(StoreError, match=words) as caught:
        study(300).run(store=folder)
    assert caught.value.path == str(folder / "_store.lock")
    assert tadcore.load_study(folder).table.equals(whole.table)


def test_a_pipe_for_a_table_of_gains_is_refused(tmp_path):
    put(tmp_path / "table", "a pipe")
    with pytest.raises(ScenarioError, match="must be a table that a study has saved, or a new name: this is a pipe"):
        study(50).run(table=tmp_path / "table")
    assert (tmp_path / "table").is_fifo()


def test_links_that_lead_nowhere_or_in_circles_are_named(tmp_path, capsys):
    (tmp_path / "circle.toml").symlink_to(tmp_path / "circle.toml")
    with pytest.raises(ScenarioError, match=r"circle\.toml: got 'Too many levels of symbolic links'"):
        Scenario.from_toml(tmp_path / "circle.toml")
    with pytest.raises(SystemExit, match="2"):
        main(["validate", str(tmp_path / "circle.toml")])
    assert "must be a file" in capsys.readouterr().err
    folder = tmp_path / "store"
    study(300).run(store=folder)
    for target in (tmp_path / "nowhere", folder / part(0, 300)):
        (folder / part(0, 300)).unlink()
        (folder / part(0, 300)).symlink_to(target)
        with pytest.raises(StoreError, match=part(0, 300)):
            tadcore.load_study(folder)


def test_a_part_that_is_a_link_is_read_only_if_it_is_the_part(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    whole = study(300).run(store=one)
    study(300, seed=8).run(store=other)
    (one / part(0, 300)).rename(tmp_path / "elsewhere")
    (one / part(0, 300)).symlink_to(tmp_path / "elsewhere")
    assert tadcore.load_study(one).table.equals(whole.table)
    (one / part(0, 300)).unlink()
    (one / part(0, 300)).symlink_to(other / part(0, 300))
    with pytest.raises(StoreError, match="it belongs to another study"):
        tadcore.load_study(one)


@pytest.mark.parametrize("given", [None, 5, True, b"x.toml", "", "a\0b", ["x"]])
def test_what_names_no_file_is_refused(given):
    wanted = study(10)
    uses = [Scenario.from_toml, tadcore.Study.from_toml, tadcore.load_study]
    uses += [lambda path: wanted.run(store=path), lambda path: wanted.run(table=path)] if given is not None else []
    for use in uses:
        with pytest.raises(ScenarioError, match=r"must be a path: a string or a pathlib"):
            use(given)


def test_a_file_too_large_is_not_read_to_its_end(tmp_path):
    with (tmp_path / "large.toml").open("wb") as stream:
        stream.truncate(1 << 40)  # a hole: nothing on the disk
    with pytest.raises(ScenarioError, match="must be a file of at most 8 MiB"):
        Scenario.from_toml(tmp_path / "large.toml")
    folder = tmp_path / "store"
    study(300).run(store=folder)
    with (folder / "_manifest.json").open("r+b") as stream:
        stream.truncate(1 << 40)
    with pytest.raises(StoreError, match="it has more than 8 MiB"):
        tadcore.load_study(folder)


@pytest.mark.parametrize("part", ["a", '"a b"', "'='", '"\\"."', "_-9"])
@pytest.mark.parametrize("text", ["{}.x = 1", "[{}.x]", "y = {{ {}.x = 1 }}", "\n\n{}.x = 1"])
def test_a_key_of_many_parts_is_refused_before_it_is_parsed(part, text):
    """Fifty thousand parts take the parser ten gigabytes."""
    with pytest.raises(ScenarioError, match=r"line \d: got .*, must be valid TOML with keys of at most 100 parts"):
        parse_toml(text.format(".".join([part] * 50_000)), "given")
    assert parse_toml(text.format(".".join([part] * 50)), "given")


LONG = ".".join("a" * 60) * 2  # what a dotted key must not be, so that every text is read for one


@pytest.mark.parametrize(
    "text",
    [
        '# {} \\"',
        "# {} \\'",
        '#{}\n"',
        "#{}\n'",
        '#{}\nx = "\\"',
        '#{}\nx = """\\"',
        '#{}\n"\\\n',
        '#{}\nx = """"',
        "#{}\nx = " + 4 * "'",
        "#{}\nx ",
        "#{}\n[",
        '#{}\n["(at ',
        "{}.",
        '"{}.',
        "x = [1.5, {}",
    ],
)
def test_reading_takes_time_in_proportion_to_the_text(text):
    """The last character, repeated, is where a search that starts anew at each would take the square of the time."""
    head, _, tail = text.rpartition("{}")
    stem, last = tail[:-2], tail[-2:]

    def seconds(count):
        given = head + LONG + stem + last * count
        given += given.replace(LONG, "") if "[" in tail else ""  # a table twice: the parser's reason has its name in it
        start = time.process_time()
        with contextlib.suppress(ScenarioError):
            parse_toml(given, "given")
        return time.process_time() - start

    assert seconds(400_000) < 40 * max(seconds(20_000), 0.01)


@pytest.mark.parametrize("deep", [100, 101])
@pytest.mark.parametrize(
    "text",
    [
        'x = {{ a = """x"""", {} = 1 }}',
        "x = {{ a = QQQxQQQQ, {} = 1 }}".replace("Q", "'"),
        'x = """ \\""" """\n{} = 1',
        'x = "\\"" # "\n{} = 1',
    ],
)
def test_no_string_hides_a_key_of_many_parts(text, deep):
    key = ".".join("b" * deep)
    if deep == 100:
        assert parse_toml(text.format(key), "given")
    else:
        with pytest.raises(ScenarioError, match="keys of at most 100 parts"):
            parse_toml(text.format(key), "given")


@pytest.mark.parametrize(
    "encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "utf-32-le", "utf-32-be"]
)
def test_a_text_with_a_byte_order_mark_is_read(tmp_path, encoding):
    """PowerShell 5.1 writes UTF-16 for ``>``."""
    mark = "\ufeff" if encoding[-2:] in ("le", "be") else ""
    file = tmp_path / "given.toml"
    file.write_bytes((mark + "# \u03bb, \u96fb, \U0001f9ea\r\n" + TEXT).encode(encoding))
    assert Scenario.from_toml(file) == Scenario.from_toml_string(TEXT)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-32-le", "latin-1", "gbk"])
def test_another_encoding_is_named(tmp_path, encoding):
    file = tmp_path / "given.toml"
    file.write_bytes(f"# \xe9\n{TEXT}".encode(encoding))
    with pytest.raises(ScenarioError, match=r"given\.toml: got .*, must be text in UTF-8, or in UTF-16 with"):
        Scenario.from_toml(file)
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioError, match=r"must be text in UTF-8"):
        Scenario.from_toml(file)


@pytest.mark.parametrize("given", [None, 5, b"horizon = 1", ["x"], 1.5])
def test_what_is_no_text_is_refused(given):
    for use in (Scenario.from_toml_string, tadcore.Study.from_toml_string):
        with pytest.raises(ScenarioError, match="must be a text in TOML"):
            use(given)


def test_numbers_and_sentences_are_no_long_keys():
    line = f"x = [{', '.join(['-1.5'] * 500)}]  # {'a sentence. ' * 500}\n"
    assert parse_toml(line + f'y = "{"https://docs.python.org/3/library " * 200}"', "given").keys() == {"x", "y"}


def test_a_team_beyond_all_games_is_one_error():
    head = TEXT.split("[[defenders]]")[0]
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_toml_string(head + "[[defenders]]\n" * 20_000)
    assert str(caught.value) == "defenders: got '20,000 defenders', must be a list of at most 1,000 defenders"


def test_of_very_many_errors_the_first_are_listed():
    many = "".join(f"a{i} = 1\n" for i in range(20_000))
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_toml_string(many + TEXT)
    assert len(caught.value.errors) == 20_000
    lines = str(caught.value).split("\n")
    assert (lines[0], lines[-1], len(lines)) == ("20,000 fields cannot be accepted:", "  … and 19,950 more", 52)


HIDDEN = "\x1b[2J\x1b[31m\x07\u202e\r"


def test_no_message_moves_the_cursor_of_a_terminal(tmp_path, capsys):
    """Names come from strangers' files: what a terminal would obey is escaped."""
    escaped = "".join(f"\\u{ord(c):04x}" if not c.isprintable() else c for c in HIDDEN)
    (tmp_path / "given.toml").write_text(f'"{escaped}" = 3\n' + TEXT, encoding="utf-8")
    with pytest.raises(SystemExit, match="2"):
        main(["validate", str(tmp_path / "given.toml")])
    said = capsys.readouterr().err
    assert r"\x1b[2J\x1b[31m\x07\u202e\r: got 3, must be left out" in said
    assert said.replace("\n", "").isprintable()
    with pytest.raises(ScenarioError) as refused:
        tadcore.Study(calm(), {HIDDEN: Box(0, 1)}, trials=1)
    assert str(refused.value).isprintable()
    study(300).run(store=tmp_path / "store")
    for changes in ({"format": HIDDEN}, {"design": HIDDEN}, {"created": [HIDDEN]}, {"vary": {HIDDEN: {HIDDEN: 1}}}):
        folder = tmp_path / "store"
        before = (folder / "_manifest.json").read_bytes()
        resealed(folder, **changes)
        with pytest.raises((StoreError, ScenarioError)) as refused:
            tadcore.load_study(folder)
        assert str(refused.value).isprintable()
        (folder / "_manifest.json").write_bytes(before)


def test_a_long_name_does_not_fill_the_screen():
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_toml_string("a" * 100_000 + " = 1\n" + TEXT)
    assert caught.value.field == "a" * 100_000
    assert len(str(caught.value)) < 2_000


@pytest.mark.parametrize(
    "changes",
    [
        {"trials": -5},
        {"trials": True},
        {"stopped": -3},
        {"stopped": 10**20},
        {"seed": "7"},
        {"seed": 7.0},
        {"chunk": 8192.5},
        {"columns": 5},
        {"columns": [[1]]},
        {"scenario": None},
        {"vary": [["attacker.position", {}]]},
        {"environment": [["machine", "x"]]},
        {"tadcore_version": 1},
    ],
    ids=lambda changes: " ".join(f"{name} {value}" for name, value in changes.items()),
)
def test_an_entry_of_a_manifest_is_not_taken_for_what_it_is_not(tmp_path, changes):
    study(300).run(store=tmp_path)
    resealed(tmp_path, **changes)
    with pytest.raises(StoreError, match=f"it is no manifest of a study \\(its {next(iter(changes))} is "):
        tadcore.load_study(tmp_path)


@pytest.mark.parametrize("path", ["defenders.7.position", "defenders[7].visibility_radius", "defenders.3.position.x"])
def test_a_defender_that_is_not_there_is_answered_with_those_that_are(path):
    with pytest.raises(ScenarioError, match=r"of this game, which has 3 defenders, d1 to d3$"):
        tadcore.Study(calm(), {path: Box(0, 1)}, trials=1)
    with pytest.raises(ScenarioError, match=r"which has 3 defenders, d1 to d3$"):
        calm().replace({"defenders[7].capture_radius": 0.2})
    alone = Scenario.from_toml_string("[[defenders]]".join(TEXT.split("[[defenders]]")[:2]))
    with pytest.raises(ScenarioError, match=r"which has 1 defender, d1$"):
        tadcore.Study(alone, {"defenders.1.capture_radius": Box(0.1, 1)}, trials=1)


def test_a_masked_entry_is_no_number():
    """What stands under a mask is whatever was there before."""
    sc = calm()
    holes = np.ma.masked_greater(sc.positions, 1.0)
    with pytest.raises(ScenarioError, match="positions: got 'an array with masked entries'"):
        tadcore.simulate_batch(sc, np.ma.stack([holes]))
    with pytest.raises(ScenarioError, match="visibility_radii: got 'an array with masked entries'"):
        tadcore.simulate_batch(sc, [sc.positions], visibility_radii=np.ma.masked_equal([1.0, 2.0, 3.0], 2.0))
    point = np.ma.masked_equal([0.5, 2.0], 2.0)
    for draw in (lambda: Box(point, [3.0, 3.0]), lambda: Choice(np.ma.stack([point]))):
        with pytest.raises(ScenarioError):
            draw()
    with pytest.raises(ScenarioError, match="got 'an array with masked entries', must be an array of numbers of shape"):
        tadcore.Study(sc, {"attacker.position": lambda rng, size: np.ma.stack([point] * size)}, trials=5).run()
    whole = tadcore.simulate_batch(sc, np.ma.stack([sc.positions]))
    assert whole[0] == tadcore.simulate(sc).outcome


def test_a_whole_number_beyond_all_doubles_is_refused():
    with pytest.raises(ScenarioError, match=r"hysteresis: got 1000.*, must be a finite number of at least 0"):
        tadcore.simulate(calm(), hysteresis=10**400)
