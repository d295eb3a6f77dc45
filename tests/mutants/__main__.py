"""One sign flipped or one operator swapped in each formula of the core: does a Rust test notice?

    python tests/mutants [--only WORD …]

Copies the sources and, room by room, writes its mutants of `listed.py` beside the original behind a switch, builds the
tests and runs them once per mutant, the quick ones first, up to the first failure. Prints a table: file, formula, the
test that failed. Leaves with 1 if a mutant survives and `listed.py` does not say why, or if the tests fail without any
mutant.
"""

import argparse
import json
import os
import re
import resource
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

from listed import EQUIVALENT, MUTANTS

ROOT = Path(__file__).resolve().parents[2]
CORE = Path("rust/tadcore/src")
# In this order, but for the equations their own tests before the runs. Properties draw games from a fixed seed.
TESTS = ["tadcore", "synthesis", "paper", "ensemble", "properties", "riccati"]
ENVIRONMENT = {"PROPTEST_CASES": "24", "PROPTEST_RNG_SEED": "20250117"}
# Seconds of the processor after which a test program hangs, as a multiple of its time without a mutant and at least; a
# busy machine changes nothing in them. On the clock, for what sleeps for ever, so many times as long.
PATIENCE, LEAST, CLOCK = 10.0, 20.0, 20.0
SWITCH = """
#[doc(hidden)]
pub static MUTANT: std::sync::LazyLock<usize> =
    std::sync::LazyLock::new(|| std::env::var("TADCORE_MUTANT").ok().and_then(|v| v.parse().ok()).unwrap_or(0));

/// Whether the mutant of this number is to be run.
#[doc(hidden)]
#[inline(always)]
pub fn mutant(number: usize) -> bool {
    *MUTANT == number
}
"""


def numbered():
    """All mutants in order: (number, file, formula, marked text, replacement)."""
    rows = [(file, *mutant) for file, mutants in MUTANTS.items() for mutant in mutants]
    names = [row[:2] for row in rows]
    twice = {name for name in names if names.count(name) > 1}
    unknown = set(EQUIVALENT) - set(names)
    if twice or unknown:
        sys.exit(f"named twice: {twice or 'none'}; explained but not listed: {unknown or 'none'}")
    return [(number, *row) for number, row in enumerate(rows, start=1)]


def place(text, marked, where):
    """First and last position of the marked part in a source text that holds its surroundings once."""
    before, part, after = re.fullmatch("(.*?)«(.*)»(.*)", marked, re.S).groups()
    if text.count(before + part + after) != 1:
        sys.exit(f"{where}: not once in the source: {before + part + after}")
    start = text.index(before + part + after) + len(before)
    return start, start + len(part)


def planted(file, text, mutants):
    """A source text with its mutants, each a choice at run time."""
    edits = []
    for number, own, formula, marked, instead in mutants:
        if own == file:
            edits.append((*place(text, marked, f"{file}, {formula}"), number, instead))
    edits.sort(reverse=True)
    for (first, *_), (_, last, *_) in pairwise(edits):
        if last > first:
            sys.exit(f"{file}: two mutants overlap")
    for first, last, number, instead in edits:
        part = text[first:last]
        choice = f"if crate::mutant({number}) {{ {instead} }} else {{ {part} }}"
        text = text[:first] + (choice if part.endswith(";") else f"({choice})") + text[last:]
    return text


def copy(tree, mutants):
    """Makes `tree` the workspace with the mutants; a file that is as it was keeps its time and is not built again."""
    paths = [path for folder in ["rust", "tests/rust", "benches"] for path in (ROOT / folder).rglob("*")]
    wanted = {path.relative_to(ROOT) for path in paths if path.suffix in {".rs", ".toml", ".html"}}
    wanted |= {Path("Cargo.toml"), Path("Cargo.lock"), Path("README.md")}
    for old in [path for path in tree.rglob("*") if path.is_file() and path.relative_to(tree) not in wanted]:
        old.unlink()
    for path in wanted:
        text = (ROOT / path).read_text()
        if path.is_relative_to(CORE):
            text = planted(path.relative_to(CORE).as_posix(), text, mutants)
            text += SWITCH if path == CORE / "lib.rs" else ""
        copied = tree / path
        if not copied.exists() or copied.read_text() != text:
            copied.parent.mkdir(parents=True, exist_ok=True)
            copied.write_text(text)


def build(tree, target):
    """The test programs by name."""
    command = ["cargo", "test", "--locked", "--profile", "mutants", "-p", "tadcore", "--lib", "--tests", "--no-run"]
    out = subprocess.run(
        [*command, "--message-format=json-render-diagnostics"],
        cwd=tree,
        env={**os.environ, "CARGO_TARGET_DIR": str(target)},
        capture_output=True,
        text=True,
    )
    if out.returncode:
        sys.exit(f"{out.stderr}\nthe mutants do not compile")
    messages = [json.loads(line) for line in out.stdout.splitlines()]
    made = [m for m in messages if m.get("executable") and m["reason"] == "compiler-artifact"]
    return {m["target"]["name"]: Path(m["executable"]) for m in made}


def run(program, tree, number, limit):
    """The tests that fail under a mutant, and the seconds of the processor that the program took."""
    environment = {**os.environ, **ENVIRONMENT, "TADCORE_MUTANT": str(number)}
    began = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        out = subprocess.run(
            [program, "--test-threads=1"],
            cwd=tree / "rust/tadcore",
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            timeout=limit and CLOCK * limit,
            preexec_fn=limit and (lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 5))),
        )
    except subprocess.TimeoutExpired:
        return ["no end"], limit
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    failed = re.findall(r"^test (\S+) \.\.\. FAILED", out.stdout, re.M)
    if out.returncode and not failed:
        failed = ["no end" if out.returncode == -signal.SIGXCPU else f"exit {out.returncode}"]
    return failed, ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime


def verdict(found, tests, programs, tree, limits):
    """What a mutant's table row says, and whether that is as it should be."""
    number, file, formula, *_ = found
    for name in sorted(tests, key=lambda name: name not in ("tadcore", file.split("/")[0])):
        failed, _ = run(programs[name], tree, number, limits[name])
        if failed:
            break
    reason = EQUIVALENT.get((file, formula))
    if failed:
        more = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
        said = f"{name}: {failed[0]}{more}" + ("  (but said to be equivalent)" if reason else "")
    else:
        said = f"survived: {reason}" if reason else "SURVIVED"
    print(f"{file:26} {formula:42} {said}", flush=True)
    return bool(failed), bool(failed) != bool(reason)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--only", nargs="+", default=[""], help="mutants whose file or formula contains one of these")
    only = parser.parse_args().only
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    tree = target / "mutants-tree"
    rooms = {}
    for mutant in numbered():
        if any(word in f"{mutant[1]} {mutant[2]}" for word in only):
            rooms.setdefault(mutant[1].split("/")[0], []).append(mutant)
    print(f"{'file':26} {'formula':42} caught by", flush=True)
    caught, unexplained = 0, 0
    # A room at a time: where every loop holds a choice the tests are slow, and so is the compiler.
    for chosen in rooms.values():
        copy(tree, chosen)
        programs = build(tree, target)
        tests = [name for name in TESTS if name in programs]
        limits = {}
        for name in tests:
            failed, seconds = run(programs[name], tree, 0, None)
            if failed:
                sys.exit(f"without a mutant, {name}: {', '.join(failed)}")
            limits[name] = max(LEAST, PATIENCE * seconds)
        for mutant in chosen:
            failed, expected = verdict(mutant, tests, programs, tree, limits)
            caught, unexplained = caught + failed, unexplained + (not expected)
    total = sum(map(len, rooms.values()))
    print(f"{total} mutants: {caught} caught, {total - caught} survived, {unexplained} unexplained")
    return bool(unexplained)


if __name__ == "__main__":
    sys.exit(main())
