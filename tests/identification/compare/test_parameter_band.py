import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.identification.compare import compare
from robustpolish.identification.free_runs import parameter_band
from tests.identification.oscillators import oscillator, record

TIME = np.linspace(0.0, 1.0, 11)


def ramps(model):
    """Outputs that are linear in stiffness, and in stiffness and damping."""
    stiffness, damping = (model.parameters[k] for k in ("spring[0].stiffness", "damper[0].damping"))
    return np.column_stack([stiffness * TIME, stiffness * TIME + 2 * damping])


def test_independent_errors_add_up_by_their_squares():
    errors = {"spring[0].stiffness": 4.0, "damper[0].damping": 3.0, "dof.x.mass": 0.0}
    width = parameter_band(oscillator(), errors, ramps)
    np.testing.assert_allclose(width[:, 0], 1.96 * 4 * TIME, atol=1e-9)
    np.testing.assert_allclose(width[:, 1], 1.96 * np.hypot(4 * TIME, 6), rtol=1e-9)


def test_standard_errors_make_a_band():
    data = record()
    result = compare(oscillator(), data, standard_errors={"spring[0].stiffness": 4.0})
    off = compare(oscillator(stiffness=404.0), data)
    difference = np.abs(off.simulated["x"] - result.simulated["x"])
    assert np.corrcoef(result.band["x"], difference)[0, 1] > 0.99


def test_refused():
    with pytest.raises(InvalidInputError, match=r"spring\[7\]"):
        parameter_band(oscillator(), {"spring[7].stiffness": 4.0}, ramps)
    with pytest.raises(InvalidInputError, match="standard_errors"):
        parameter_band(oscillator(), {"spring[0].stiffness": -4.0}, ramps)
