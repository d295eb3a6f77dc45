"""Any bytes as a scenario, a study file or a manifest: read without loss, or refused by an error of ours.

    python fuzz/scenario.py CORPUS [SEEDS] -max_total_time=20

Needs atheris. What is accepted must be written and read again to the bit; any exception but `ScenarioError` and
`StoreError` is a finding.
"""

import contextlib
import json
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["tadcore", "tomllib"]):
    import tadcore
    from tadcore.study.manifest import SEAL, Manifest, seal

FOLDER = Path(tempfile.mkdtemp(prefix="tadcore-fuzz-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))


def scenario(path):
    """Read, write, read."""
    sc = tadcore.Scenario.from_toml(path)
    text = sc.to_toml()
    assert tadcore.Scenario.from_toml_string(text) == sc, "a scenario is not read back as it was written"
    assert tadcore.Scenario.from_toml_string(text).to_toml() == text, "two texts of one scenario differ"


def study(path):
    """Read."""
    tadcore.Study.from_toml(path)


def manifest(path):
    """Read as what describes a store without parts; its digest is made right, so that more than the digest is met."""
    path.rename(FOLDER / "_manifest.json")
    with contextlib.suppress(ValueError, RecursionError, AttributeError):
        content = json.loads((FOLDER / "_manifest.json").read_bytes())
        content.pop(SEAL, None)
        (FOLDER / "_manifest.json").write_text(json.dumps(content | {SEAL: seal(content)}))
    made = Manifest.read(FOLDER)
    tadcore.load_study(FOLDER)
    assert made.study == Manifest.read(FOLDER).study, "a manifest changes by being read"


def one(data):
    """The first byte says what the others are."""
    if not data:
        return
    path = FOLDER / "given.toml"
    path.write_bytes(data[1:])
    with contextlib.suppress(tadcore.ScenarioError, tadcore.StoreError):
        (scenario, study, manifest)[data[0] % 3](path)


def seeds(folder):
    """The bundled scenarios, a study file and a manifest, as a corpus to begin with."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in tadcore.scenarios.names():
        text = tadcore.scenarios.load(name).to_toml()
        (folder / name).write_bytes(b"\x00" + text.encode())
        asked = f'scenario = "{name}"\ntrials = 10\nseed = 3\ndesign = "sobol"\n\n[vary]\n'
        asked += '"attacker.position" = { disk = { center = [0, 1], radius = 2 } }\n'
        asked += '"defenders.*.visibility_radius" = { scipy = "uniform", loc = 0.5, scale = 4 }\n'
        (folder / f"study-{name}").write_bytes(b"\x01" + asked.encode())
        table = {"attacker.position": {"box": {"low": [0.0, 0.0], "high": [1.0, 1.0]}}}
        made = Manifest(text, table, 7, "random", 100, ("attacker.position.x", "attacker.position.y"))
        (folder / f"manifest-{name}").write_bytes(b"\x02" + made.to_json().encode())


if __name__ == "__main__":
    if len(sys.argv) > 1 and not sys.argv[1].startswith("-"):
        seeds(Path(sys.argv[1]))
    atheris.Setup(sys.argv, one)
    atheris.Fuzz()
