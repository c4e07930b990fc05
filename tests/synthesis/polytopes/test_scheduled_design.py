"""What a scheduled design does with numbers and signals."""

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp

k = rp.uncertain.real("k", 5.0, range=(1.0, 9.0))
PLANT = rp.uncertain.system([[0, 1], [-k, -0.1]], [[0, 0], [1, 1]], [[1, 0]], 0)


@pytest.fixture(scope="module")
def design():
    return rp.scheduled_feedback(PLANT, controls=1, control_weight=1.0)


def test_at_rest_the_simulation_is_that_of_the_frozen_loop(design):
    t = np.linspace(0, 2, 101)
    push = xr.Dataset({"u[0]": ("time", np.sin(t))}, coords={"time": t})
    moved = design.simulate(push, {"k": np.full(t.size, 3.0)})
    still = rp.simulate(design.closed_loop({"k": 3.0}), push)
    for name in still:
        assert moved[name].to_numpy() == pytest.approx(still[name].to_numpy(), abs=1e-13)


def test_names_are_those_of_the_plant(design):
    controller = design.at({"k": 2.0})
    assert controller.output_labels == ["u[1]"]
    assert controller.input_labels == ["measured_x[0]", "measured_x[1]"]
    assert "k" in repr(design)
    assert "1 to 9, jumps" in repr(design)
    assert [dict(point) for point in design.points] == [{"k": 1.0}, {"k": 9.0}]


def test_wrong_signals_are_told(design):
    t = np.linspace(0, 1, 11)
    push = xr.Dataset({"u[0]": ("time", t)}, coords={"time": t})
    with pytest.raises(rp.InvalidInputError, match="11 as of time"):
        design.simulate(push, {"k": [3.0]})
    with pytest.raises(rp.InvalidInputError, match="unknown key"):
        design.simulate(push.rename({"u[0]": "F"}), {"k": np.full(11, 3.0)})
    with pytest.raises(rp.InvalidInputError, match="within its range only"):
        design.simulate(push, {"k": np.full(11, 0.5)})
