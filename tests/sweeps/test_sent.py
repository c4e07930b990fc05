"""Systems of control go to other processes and come back to the bit."""

import pickle
from functools import partial
from types import MappingProxyType

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.sweep import as_bytes
from tests.sweeps import functions


def test_a_system_comes_back_to_the_bit():
    system = control.StateSpace(
        [[-1.0, 1 / 3], [0.0, -2.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], 0.1,
        inputs=["F"], outputs=["x"], states=["a", "b"], name="machine",
    )  # fmt: skip
    back = pickle.loads(as_bytes(system))
    assert all(
        np.array_equal(getattr(back, name), getattr(system, name)) for name in ("A", "B", "C", "D")
    )
    assert (back.dt, back.name, back.state_labels) == (0.1, "machine", ["a", "b"])
    assert (back.input_labels, back.output_labels) == (["F"], ["x"])


def test_the_same_plant_gives_the_same_bytes_whatever_else_was_made():
    first, _, second = rp.air_bearing(), control.ss(-1, 1, 1, 0), rp.air_bearing()
    assert first.system.name != second.system.name
    assert as_bytes(first) == as_bytes(second)


def test_a_read_only_mapping_stays_one():
    back = pickle.loads(as_bytes({"a": MappingProxyType({"b": 1})}))["a"]
    assert isinstance(back, MappingProxyType)
    assert back == {"b": 1}


@pytest.mark.long
def test_a_plant_can_be_bound_to_a_function_of_other_processes():
    poles = partial(functions.slowest_pole, rp.air_bearing())
    found = rp.sweep(poles, {"factor": [1.0, 2.0]})
    assert (found.failure == "").all()
    assert found.identical(rp.sweep(poles, {"factor": [1.0, 2.0]}, executor="serial"))


def test_what_no_other_process_can_build_is_refused():
    with pytest.raises((pickle.PicklingError, AttributeError, TypeError)):
        as_bytes(lambda: 0)
