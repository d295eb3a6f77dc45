"""What the library depends on, looked at without a network: licences, sources, and what may not be there at all.

    python tests/audit.py

Reads `cargo metadata` of the committed lock file and the metadata of the installed Python packages. Known
vulnerabilities need a database: they are asked of cargo-audit and pip-audit where these are installed and reach one,
and the last lines say whether that was so. Leaves with 1 if anything is amiss.
"""

import json
import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CRATES_IO = "registry+https://github.com/rust-lang/crates.io-index"
ALLOWED = {
    "MIT",
    "MIT-0",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "ISC",
    "PSF-2.0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
    "0BSD",
}
NOT_IN_THE_CORE = {"pyo3", "numpy", "tokio", "reqwest", "hyper", "openssl", "openssl-sys", "libloading", "bincode"}
PERMISSIVE = re.compile(r"MIT|BSD|Apache|PSF|Python Software Foundation|ISC|Unlicense|MPL|Mozilla|HPND|Zlib", re.I)


def licensed(expression):
    """Whether an SPDX expression can be met by allowed licences: OR needs one side, AND needs both."""
    expression = expression.strip()
    while expression.startswith("(") and expression.endswith(")") and expression.count("(") == 1:
        expression = expression[1:-1]
    if " AND " in expression:
        return all(licensed(side) for side in expression.split(" AND "))
    sides = re.split(r" OR |/", expression)
    return licensed(sides[0]) or licensed(" OR ".join(sides[1:])) if len(sides) > 1 else expression in ALLOWED


def crates():
    """Problems of the Rust side, and how many crates were looked at."""
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--manifest-path", str(ROOT / "Cargo.toml")]
    found = json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout)
    problems = []
    for package in found["packages"]:
        name = f"{package['name']} {package['version']}"
        if package["source"] not in (None, CRATES_IO):
            problems.append(f"{name}: comes from {package['source']}")
        if not licensed(package["license"] or ""):
            problems.append(f"{name}: licence {package['license']}")
    tree = ["cargo", "tree", "--locked", "--package", "tadcore", "--edges", "normal", "--prefix", "none"]
    core = {
        line.split()[0]
        for line in subprocess.run(tree, capture_output=True, check=True, text=True, cwd=ROOT).stdout.split("\n")
        if line
    }
    problems += [f"{name}: has no place in the core" for name in sorted(core & NOT_IN_THE_CORE)]
    return problems, f"{len(found['packages'])} crates, {len(core)} of them in the core"


def packages():
    """Problems of the Python side: everything that `pip install tadcore` brings."""
    waiting, seen, problems = ["tadcore"], set(), []
    while waiting:
        name = waiting.pop().lower().replace("_", "-")
        if name in seen:
            continue
        seen.add(name)
        try:
            about = metadata.metadata(name)
        except metadata.PackageNotFoundError:
            problems.append(f"{name}: is required and not installed")
            continue
        said = [about.get("License-Expression") or "", about.get("License") or "", *(about.get_all("Classifier") or [])]
        if not PERMISSIVE.search("\n".join(said)):
            problems.append(f"{name}: no permissive licence is named")
        for requirement in metadata.requires(name) or []:
            if "extra ==" not in requirement and not re.search(r"(win32|Windows|python_version <)", requirement):
                waiting.append(re.match(r"[\w.-]+", requirement)[0])
    return problems, f"{len(seen)} packages"


def vulnerabilities(name, command):
    """What a scanner says, or that it was not asked."""
    if shutil.which(command[0]) is None:
        return [], f"not asked: {command[0]} is not installed"
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    if done.returncode == 0:
        return [], "none known"
    words = (done.stdout + done.stderr).strip()
    if re.search(r"fetch|connect|resolve|network|HTTPError|timed out", words, re.I):
        return [], f"not asked: {name}'s database was not reached"
    return [words], "see above"


def main():
    """Print what was looked at and what is amiss."""
    checks = {
        "licences and sources of crates": crates,
        "licences of packages": packages,
        "vulnerabilities of crates": lambda: vulnerabilities("cargo-audit", ["cargo-audit", "audit"]),
        "vulnerabilities of packages": lambda: vulnerabilities("pip-audit", ["pip-audit", "--skip-editable"]),
    }
    failed = False
    for name, check in checks.items():
        problems, looked_at = check()
        failed |= bool(problems)
        print(f"{name}: {looked_at}" + "".join(f"\n  {problem}" for problem in problems))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
