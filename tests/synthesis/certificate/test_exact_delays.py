"""What certificates say of delays."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.certificate import exact_delays


def plant(order=3, seconds=0.5):
    lag = control.tf([1], [1, 1], inputs="u", outputs="y")
    return rp.GeneralizedPlant.from_loop(lag).with_delay("u", seconds, order=order)


def test_the_gain_is_that_of_the_exact_loop():
    found = rp.certify(plant(1), [[-3.0]]).exact_delays
    largest = 0.0
    for w in np.linspace(0.01, 12, 40001):
        lag, delay = 1 / (1 + 1j * w), np.exp(-0.5j * w)
        S = 1 / (1 + 3 * lag * delay)
        # The effort shows the delayed command, which is what acts.
        blocks = S * np.array([[1], [-3 * delay]]) @ np.array([[1, lag]])
        largest = max(largest, np.linalg.norm(blocks, 2))
    assert found.stability
    assert found.gain == pytest.approx(largest, rel=1e-4)
    assert found.orders == {"u": 1}


def test_a_loop_that_only_the_pade_model_finds_stable_is_refused():
    # 1/s with gain k and delay T: stable up to k T = pi / 2, of Pade's order 1 up to 2.
    integrator = control.tf([1], [1, 0], inputs="u", outputs="y")
    rough = rp.GeneralizedPlant.from_loop(integrator).with_delay("u", 1.0, order=1)
    certificate = rp.certify(rough, [[-1.8]])
    assert certificate.stable
    assert not certificate.valid
    assert "unstable with its delays as they are" in certificate.reasons[0]
    with pytest.raises(rp.SolverError, match="raise order= of with_delay"):
        rp.given_controller(rough, [[-1.8]])
    good = rp.certify(rough, [[-1.5]])
    assert good.valid
    assert "stable" in str(good.exact_delays)


def test_plants_without_delays_say_nothing_of_them():
    lag = control.tf([1], [1, 1])
    none = rp.GeneralizedPlant.from_loop(lag)
    assert exact_delays(none, none.static_controller([[-1.0]]), "hinf") is None
    assert rp.certify(none, [[-1.0]]).exact_delays is None
    sampled = control.ss([[0.5]], [[1.0]], [[1.0]], 0, 0.1, inputs="u", outputs="y")
    chain = rp.GeneralizedPlant.from_loop(sampled).with_delay("u", 0.2)
    assert rp.certify(chain, [[-0.1]]).exact_delays is None


@pytest.mark.parametrize("norm", ["hinf", "h2"])
@pytest.mark.parametrize("split", [True, False])
def test_designs_are_checked_with_exact_delays(norm, split, tmp_path):
    wired = plant(2, 0.2).with_sensor("y", noise=0.1).with_actuator("u", 3.0)
    wired = wired.part(disturbances=[1, 2], performance=[0])
    design = rp.output_feedback(wired, norm, control_weight=0.1, split=split)
    assert dict(design.plant.delays) == {"u": 0.2}
    assert design.certificate.exact_delays.stability
    assert (design.certificate.exact_delays.gain is None) == (norm == "h2")
    assert "with the exact delays the loop is stable" in str(design)
    design.save(tmp_path / "design.json")
    assert rp.load(tmp_path / "design.json").certificate.exact_delays.stability


def test_other_methods_are_checked_too():
    design = rp.static_output_feedback(plant(2, 0.2))
    assert design.certificate.exact_delays.stability
    with pytest.raises(rp.InvalidInputError, match="delays, which have infinitely many states"):
        rp.state_feedback(plant(2, 0.2))
