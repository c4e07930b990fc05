"""Whatever users call a system."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.plants.blocks import as_state_space, realised

POINTS = 1j * np.array([0.0, 0.3, 1.7, 20.0])


def test_a_transfer_function_keeps_response_and_names():
    G = control.tf([2.0, 1.0], [1.0, 0.2, 9.0], inputs="F", outputs="x")
    plant = rp.GeneralizedPlant(G, measurements="x", controls="F")
    for s in POINTS:
        assert complex(plant.system(s)) == pytest.approx(complex(G(s)))
    assert (plant.measurement_names, plant.control_names, plant.nx) == (("x",), ("F",), 2)


def test_several_inputs_and_outputs_keep_their_response():
    num = [[[1.0], [2.0, 1.0]], [[3.0], [1.0, 0.0]]]
    den = [[[1.0, 1.0], [1.0, 2.0, 3.0]], [[1.0, 1.0], [1.0, 2.0, 3.0]]]
    G = control.tf(num, den, inputs=["a", "b"], outputs=["p", "q"])
    plant = rp.GeneralizedPlant(G, measurements=["p"], controls=["a"])
    assert (plant.disturbance_names, plant.performance_names) == (("b",), ("q",))
    for s in POINTS:
        np.testing.assert_allclose(plant.system(s), G(s)[::-1, ::-1], atol=1e-12)


def test_sampling_times_are_kept_or_given():
    G = control.tf([1.0], [1.0, -0.5], 0.1)
    assert as_state_space("G", G).dt == 0.1
    assert as_state_space("G", control.tf([1.0], [1.0, -0.5], None), 0.2).dt == 0.2


def test_a_gain_and_a_system():
    gain = as_state_space("K", [[1.0, 2.0]], 0.1, ["a", "b"], ["u"])
    assert (gain.input_labels, gain.nstates, gain.dt) == (["a", "b"], 0, 0.1)
    assert as_state_space("K", 3.0).D[0, 0] == 3.0
    system = control.ss([[-1.0]], [[1.0]], [[1.0]], 0)
    assert as_state_space("K", system) is system


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (control.tf([1.0, 0.0, 0.0], [1.0, 1.0]), "G: got an improper TransferFunction"),
        (control.tf([np.inf], [1.0, 1.0]), "G: got coefficients that are not finite"),
        (control.frd([1.0], [1.0]), "G: got FrequencyResponseData"),
        (control.ss([[np.nan]], [[1.0]], [[1.0]], 0), "G.A: got nan"),
        ("1/(s+1)", "G: got '1/"),
        (None, "G: got None"),
    ],
)
def test_others_are_refused(given, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        as_state_space("G", given)


def test_no_realisation_is_believed(monkeypatch):
    G = control.tf([[[1.0], [2.0]]], [[[1.0, 1.0], [1.0, 2.0]]])
    wrong = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]])
    monkeypatch.setattr(control, "ss", lambda *_, **__: wrong)
    with pytest.raises(rp.InvalidInputError, match="realisation has another response"):
        realised("G", G)
