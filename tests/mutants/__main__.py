"""One sign flipped or one operator swapped in each formula of the core: does a Rust test notice?

    python tests/mutants [--only WORD …]

Copies the sources and, room by room, writes its mutants of `listed.py` beside the original behind a switch. The
programs of the Rust tests run once per mutant, the quick ones first, up to the first failure; one is built when the
first mutant gets to it. Prints a table: file, formula, the test that failed. Leaves with 1 if a mutant survives and
`listed.py` does not say why, or if the tests fail without any mutant.

The build is lighter than a release: little is optimised, and in the rooms of `LIGHTER` the only size with constant loop
bounds is N = 3, all others going through the version for any size. The formulas are the same lines of generic code.
"""

import argparse
import json
import os
import re
import resource
import signal
import subprocess
import sys
import threading
from itertools import pairwise
from pathlib import Path

from listed import EQUIVALENT, MUTANTS

ROOT = Path(__file__).resolve().parents[2]
# The core and its kernels, a crate of their own: a file's name is its path in either.
CRATES = {"tadcore": Path("rust/tadcore/src"), "tadcore_kernels": Path("rust/tadcore-kernels/src")}
# In this order, but for a room's own tests, in the library and beside it, which are first. Properties draw games from a
# fixed seed.
TESTS = [
    "synthesis",
    "blocks",
    "global_minimum",
    "kernels",
    "tadcore",
    "paper",
    "ensemble",
    "worlds",
    "properties",
    "riccati",
]
ENVIRONMENT = {"PROPTEST_CASES": "24", "PROPTEST_RNG_SEED": "20250117"}
# Seconds of the processor after which a test program hangs, as a multiple of its time without a mutant and at least; a
# busy machine changes nothing in them. On the clock, for what sleeps for ever, so many times as long.
PATIENCE, LEAST, CLOCK = 6.0, 6.0, 20.0
# What a room is built without: by file, lines of the source that match, and what stands there instead.
SIZES = {
    "synthesis/search/dispatch.rs": (r"^ +([245678]) => self\.run_sized::<\1>.*\n", ""),
    "ensemble/sweep.rs": (r"^ +2 1 1; .*\n", "3 2 1; 3 3 1;\n"),
}
LIGHTER = {"synthesis": SIZES, "simd": SIZES}
# The number is read before `main`, so that a choice in an inner loop is a comparison and no more.
SWITCH = """
#[doc(hidden)]
pub static mut MUTANT: usize = 0;

extern "C" fn choose() {
    let number = std::env::var("TADCORE_MUTANT").ok().and_then(|v| v.parse().ok()).unwrap_or(0);
    // SAFETY: there is one thread yet.
    unsafe { MUTANT = number };
}

#[used]
#[cfg_attr(target_os = "macos", unsafe(link_section = "__DATA,__mod_init_func"))]
#[cfg_attr(not(target_os = "macos"), unsafe(link_section = ".init_array"))]
static CHOOSE: extern "C" fn() = choose;

/// Whether the mutant of this number is to be run.
#[doc(hidden)]
#[inline(always)]
pub fn mutant(number: usize) -> bool {
    // SAFETY: written before `main` alone.
    unsafe { MUTANT == number }
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


def copy(tree, mutants, lighter):
    """Makes `tree` the workspace with the mutants; a file that is as it was keeps its time and is not built again."""
    folders = ["rust", "tests/rust", "tests/reference", "benches"]
    paths = [path for folder in folders for path in (ROOT / folder).rglob("*")]
    wanted = {path.relative_to(ROOT) for path in paths if path.suffix in {".rs", ".toml", ".html", ".json"}}
    wanted |= {Path("Cargo.toml"), Path("Cargo.lock"), Path("README.md")}
    for old in [path for path in tree.rglob("*") if path.is_file() and path.relative_to(tree) not in wanted]:
        old.unlink()
    for path in wanted:
        text = (ROOT / path).read_text()
        root = next((root for root in CRATES.values() if path.is_relative_to(root)), None)
        if root:
            own = path.relative_to(root).as_posix()
            if own in lighter:
                text, count = re.subn(*lighter[own], text, flags=re.M)
                if not count:
                    sys.exit(f"{own}: nothing to leave out")
            # A module that both have is the core's.
            if root == CRATES["tadcore"] or not (ROOT / CRATES["tadcore"] / own).exists():
                text = planted(own, text, mutants)
            text += SWITCH if own == "lib.rs" else ""
        copied = tree / path
        if not copied.exists() or copied.read_text() != text:
            copied.parent.mkdir(parents=True, exist_ok=True)
            copied.write_text(text)


def build(tree, target, name):
    """The program of the tests of this name."""
    package = "tadcore-kernels" if name == "kernels" else "tadcore"
    command = ["cargo", "test", "--locked", "--profile", "mutants", "-p", package, "--no-run"]
    out = subprocess.run(
        [*command, *(["--lib"] if name == package else ["--test", name]), "--message-format=json-render-diagnostics"],
        cwd=tree,
        env={**os.environ, "CARGO_TARGET_DIR": str(target)},
        capture_output=True,
        text=True,
    )
    if out.returncode:
        sys.exit(f"{out.stderr}\nthe mutants do not compile")
    messages = [json.loads(line) for line in out.stdout.splitlines()]
    made = [m for m in messages if m.get("executable") and m["reason"] == "compiler-artifact"]
    return next(Path(m["executable"]) for m in made if m["target"]["name"] == name)


def run(program, words, tree, number, limit):
    """The first test to fail under a mutant, of those whose names contain a word of `words`; processor's seconds."""
    environment = {**os.environ, **ENVIRONMENT, "TADCORE_MUTANT": str(number)}
    began = resource.getrusage(resource.RUSAGE_CHILDREN)
    with subprocess.Popen(
        [program, *words, "--test-threads=1"],
        cwd=tree / "rust/tadcore",
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        preexec_fn=limit and (lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 5))),
    ) as process:
        asleep = threading.Timer(CLOCK * limit if limit else 1e6, process.kill)
        asleep.daemon = True
        asleep.start()
        failed = None
        for line in process.stdout:
            if found := re.match(r"test (\S+)(?: - should panic)? \.\.\. FAILED", line):
                failed = found[1]
                process.kill()
        code = process.wait()
        asleep.cancel()
    if code and not failed:
        failed = "no end" if code in (-signal.SIGXCPU, -signal.SIGKILL) else f"exit {code}"
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return failed, ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime


class Programs:
    """The test programs of a room, each built and timed without a mutant when first asked for."""

    def __init__(self, tree, target, room):
        self.tree, self.target = tree, target
        own = [("kernels", f"{room}::"), ("tadcore", f"{room}::"), *((name, "") for name in TESTS if name == room)]
        self.order = own + [(name, "") for name in TESTS if name != room]
        self.built, self.limits = {}, {}

    def first_failure(self, number):
        for name, word in self.order:
            if name not in self.built:
                self.built[name] = build(self.tree, self.target, name)
            words = [word] if word else []
            if (name, word) not in self.limits:
                failed, seconds = run(self.built[name], words, self.tree, 0, None)
                if failed:
                    sys.exit(f"without a mutant, {name}: {failed}")
                self.limits[name, word] = max(LEAST, PATIENCE * seconds)
            failed, _ = run(self.built[name], words, self.tree, number, self.limits[name, word])
            if failed:
                return f"{name}: {failed}"
        return None


def verdict(found, programs):
    """What a mutant's table row says, and whether that is as it should be."""
    number, file, formula, *_ = found
    failed = programs.first_failure(number)
    reason = EQUIVALENT.get((file, formula))
    if failed:
        said = failed + ("  (but said to be equivalent)" if reason else "")
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
    for room, chosen in rooms.items():
        copy(tree, chosen, LIGHTER.get(room, {}))
        programs = Programs(tree, target, room)
        # Those that are said to survive go last: they need every program.
        for mutant in sorted(chosen, key=lambda mutant: mutant[1:3] in EQUIVALENT):
            failed, expected = verdict(mutant, programs)
            caught, unexplained = caught + failed, unexplained + (not expected)
    total = sum(map(len, rooms.values()))
    print(f"{total} mutants: {caught} caught, {total - caught} survived, {unexplained} unexplained")
    return bool(unexplained)


if __name__ == "__main__":
    sys.exit(main())
