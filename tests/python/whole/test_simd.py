"""The vector instructions that TADCORE_SIMD chooses: which are refused, and that all of them give one answer."""

import pytest

from widths import python, widths

PLAY = """
import hashlib, numpy as np, tadcore
sc = tadcore.scenarios.load("paper-i1")
run = tadcore.simulate(sc)
batch = tadcore.simulate_batch(sc, np.random.default_rng(7).uniform(-3, 3, (50, 5, 2)))
numbers = [run.position, run.control, run.gains, batch.kind, batch.defender, batch.time]
digest = hashlib.sha256(b"".join(np.ascontiguousarray(x).tobytes() for x in numbers)).hexdigest()
print(tadcore._core.simd(), digest)
"""


def test_every_width_of_the_processor_can_be_chosen_and_gives_the_same_bits():
    told = [python(PLAY, simd) for simd in (*widths(), None, "")]
    assert all(done.returncode == 0 for done in told), [done.stderr for done in told]
    used, digests = zip(*(done.stdout.split() for done in told), strict=True)
    assert used[:-2] == tuple(widths())
    assert used[-2:] == (widths()[-1],) * 2  # unset, and empty: the widest
    assert len(set(digests)) == 1


@pytest.mark.parametrize("value", ["sse2", "AVX2", "0"])
def test_an_unknown_word_is_refused_by_name(value):
    code = """
import tadcore
from tadcore import _core
for call in (_core.simd, lambda: tadcore.simulate(tadcore.scenarios.load("paper-i1"))):
    try:
        call()
    except tadcore.errors.TadcoreError as error:
        print(type(error).__name__, error)
"""
    done = python(code, value)
    rule = "it must be baseline, avx2 or avx512 (or empty: the widest); this processor has " + ", ".join(widths())
    assert done.stdout.splitlines() == [f'TadcoreError TADCORE_SIMD is "{value}", but {rule}'] * 2, done.stderr


def test_the_command_line_refuses_in_one_sentence():
    done = python("from tadcore.cli import main; main(['simulate', 'paper-i1'])", "wide")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith('error: TADCORE_SIMD is "wide", but it must be baseline, avx2 or avx512')
    assert "Traceback" not in done.stderr


def test_a_width_that_the_processor_lacks_is_refused_by_name():
    absent = {"baseline", "avx2", "avx512"} - set(widths())
    if not absent:
        pytest.skip("this processor has every width")
    for value in absent:
        done = python("import tadcore; tadcore._core.simd()", value)
        assert f'TADCORE_SIMD is "{value}", but this processor has only {", ".join(widths())}' in done.stderr
