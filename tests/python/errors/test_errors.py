"""What the errors carry."""

import math
import pickle

import pytest

import tadcore
from tadcore import NoEquilibriumError, OutOfMemoryError, ScenarioError, StoreError, TadcoreError, WorkerError


def test_every_error_is_one_of_ours_and_a_built_in():
    bad = ScenarioError("step", 0.007, "a divisor of the horizon (6.0)")
    none = NoEquilibriumError(0.119, 6.0, 0.005)
    assert isinstance(bad, TadcoreError)
    assert isinstance(bad, ValueError)
    assert isinstance(none, TadcoreError)
    assert isinstance(none, ArithmeticError)
    assert bad.errors == (bad,)
    assert str(bad) == "step: got 0.007, must be a divisor of the horizon (6.0)"


def test_an_escape_says_when_and_what_would_be_short_enough():
    error = NoEquilibriumError(0.11905084462320856, 6.0, 0.005)
    assert error.escape_time == 0.11905084462320856
    assert error.escape_instant == 6.0 - 0.11905084462320856
    assert error.longest_horizon == 0.115
    assert "no feedback Nash equilibrium on [0, 6]" in str(error)
    assert "finite only from t = 5.88095 on, 0.119051 before the horizon" in str(error)
    assert "0.115" in str(error)
    assert "not even one step of 0.005 is short enough" in str(NoEquilibriumError(0.001, 6.0, 0.005))


@pytest.mark.parametrize(
    ("escape", "step", "longest"),
    [
        (0.3, 0.1, 0.2),  # an escape on a node: strictly below it
        (0.30000000000000004, 0.1, 0.3),
        (0.1, 0.1, 0.0),
        (0.05, 0.1, 0.0),
        (3.2197539590990143, 0.005, 3.215),
        (1.0, 1 / 3, 2 / 3),
        (0.31, 0.3 / 3, 0.3),
    ],
)
def test_the_longest_horizon_is_the_last_multiple_below_the_escape(escape, step, longest):
    found = NoEquilibriumError(escape, 6.0, step).longest_horizon
    assert math.isclose(found, longest, rel_tol=1e-14)
    assert found < escape


def test_errors_travel_between_processes():
    none = pickle.loads(pickle.dumps(NoEquilibriumError(0.1, 6.0, 0.005)))
    assert (none.escape_time, none.horizon, none.step) == (0.1, 6.0, 0.005)
    bad = pickle.loads(pickle.dumps(ScenarioError("a", 1, "b")))
    assert (bad.field, bad.value, bad.rule) == ("a", 1, "b")
    several = ScenarioError.collect([ScenarioError("a", 1, "b"), ScenarioError("c", 2, "d")])
    again = pickle.loads(pickle.dumps(several))
    assert [e.field for e in again.errors] == ["a", "c"]
    assert str(again) == "2 fields cannot be accepted:\n  a: got 1, must be b\n  c: got 2, must be d"


def test_a_value_whose_repr_fails_does_not_hide_the_error():
    class Broken:
        def __repr__(self):
            raise RuntimeError

    assert "Broken" in str(ScenarioError("a", Broken(), "b"))


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (StoreError("out", "it is full", "make room"), "out: it is full; make room"),
        (
            OutOfMemoryError("P on the grid", 3 << 30, 2 << 30),
            "P on the grid: 3,221,225,472 bytes (3.0 GiB), more than",
        ),
        (OutOfMemoryError("P on the grid", 3 << 30), "(3.0 GiB), which the system would not give; fewer defenders"),
        (WorkerError("killed", 2, 5, "out"), "when 2 of 5 chunks were finished; they are kept in out: run the study"),
        (WorkerError("killed", 2, 5, None), "they are lost: with store=… a study keeps them"),
    ],
)
def test_faults_of_memory_stores_and_workers_say_what_to_do_and_travel(error, text):
    assert isinstance(error, TadcoreError)
    assert isinstance(error, MemoryError if isinstance(error, OutOfMemoryError) else RuntimeError)
    assert text in str(error)
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert vars(again) == vars(error)


@pytest.mark.parametrize(
    "call", [tadcore.simulate, tadcore.solve_equilibrium, lambda sc: tadcore.simulate_batch(sc, [])]
)
def test_a_name_that_no_file_has_is_no_scenario(call):
    with pytest.raises(
        tadcore.ScenarioError, match=r"scenario: got 'my\.toml', must be a file, or the name of a bundled scenario"
    ):
        call("my.toml")
