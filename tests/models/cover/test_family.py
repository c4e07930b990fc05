import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.plants.uncertain.cover import errors, read_family, response
from tests.models.cover.plants import RIGS, rig


def test_errors_make_every_plant_of_the_nominal_one():
    random = np.random.default_rng(0)
    plants = [control.rss(4, 2, 2) for _ in range(3)]
    family = read_family([control.ss(p.A, p.B, p.C, random.standard_normal((2, 2)))
                          for p in plants], None)  # fmt: skip
    nominal = family.responses[0]
    for kind in ("output", "input", "additive"):
        found = errors(family, nominal, kind)
        assert found[0] == pytest.approx(0, abs=1e-12)
        i = 7
        P0, P = nominal[i], family.responses[2][i]
        E = {
            "output": P @ np.linalg.inv(P0) - np.eye(2),
            "input": np.linalg.inv(P0) @ P - np.eye(2),
            "additive": P - P0,
        }[kind]
        assert found[2][i] == pytest.approx(np.linalg.norm(E, 2), rel=1e-9)


def test_frequencies_show_resonances():
    family = read_family(RIGS, None)
    for w in (20.0, 30.0):
        assert np.min(np.abs(family.omega - w * np.sqrt(1 - 0.1**2))) < 1e-9 * w
    assert (np.diff(family.omega) > 0).all()


def test_measured_responses_are_sorted():
    omega = np.array([3.0, 0.0, 1.0, 2.0])
    data = control.FrequencyResponseData(rig(20.0)(1j * omega + 1e-9), omega)
    family = read_family([data, data], rig(25.0))
    assert family.omega.tolist() == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(family.responses[1][:, 0, 0], rig(20.0)(1j * family.omega), 1e-6)
    assert family.models == ()


def test_response_of_sampled_systems():
    plant = control.tf([1.0], [1.0, -0.5], 0.1)
    (value,) = response(control.ss(plant), np.array([2.0]))[:, 0, 0]
    assert value == pytest.approx(plant(np.exp(0.2j)))


UNSTABLE = control.tf([1.0], [1.0, -1.0])


@pytest.mark.parametrize(
    ("plants", "nominal", "says"),
    [
        ([], None, "list of them"),
        ("plants", None, "list of them"),
        ([rig(20.0), UNSTABLE], None, "as many unstable poles"),
        ([rig(20.0), np.eye(2)], None, "1 x 1|2 x 2"),
        ([rig(20.0), control.tf([1.0], [1.0, -0.5], 0.1)], None, "sampling time"),
        ([control.FrequencyResponseData(np.ones(3), [1.0, 2, 3])], None, "a model in their middle"),
        ([control.FrequencyResponseData(np.ones(3), [1.0, 2, 3]), rig(20.0)], rig(20.0), "models"),
        ([control.FrequencyResponseData(np.ones(3), [1.0, 2, k]) for k in (3, 4)], rig(20.0),
         "another list of frequencies"),
        ([control.FrequencyResponseData(np.array([1.0, np.nan, 1]), [1.0, 2, 3])], rig(20.0),
         "not finite"),
    ],
)  # fmt: skip
def test_families_that_do_not_go_together(plants, nominal, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        read_family(plants, nominal)


def test_the_response_at_a_pole_is_the_one_beside_it():
    swing = control.ss([[0, 1], [-1, 0]], [[0], [1]], [[1, 0]], 0)
    at, beside = response(swing, np.array([1.0, 1 + 1e-8]))
    assert np.isfinite(at).all()
    assert at == pytest.approx(beside)
