import numpy as np
import pytest

from robustpolish import InvalidInputError
from robustpolish.machines.rotor.rotor import FAST, ISOTROPIC

PLACES = [0.0, 0.5, 1.5]


def test_modes_at_the_speed_are_exact_and_steady_forces_too():
    lost = ISOTROPIC.reduced(3, PLACES, speed=FAST).error()
    assert lost.frequency < 1e-11
    assert lost.steady < 1e-11
    assert lost.response < 1e-3
    assert lost.speed == FAST
    assert lost.band_hz == pytest.approx(716.719 / (2 * np.pi), rel=1e-5)


def test_what_each_method_costs():
    found = {
        method: ISOTROPIC.reduced(3, PLACES, method).error()
        for method in ("static", "craig_bampton", "modal")
    }
    assert found["static"].response < 1e-3
    # Modes of the rotor held at its ports are not its own: the frequencies are near, not exact.
    assert 1e-4 < found["craig_bampton"].frequency < 0.005
    assert found["static"].frequency < 1e-11
    assert found["modal"].steady > 0.1  # without deflections, steady forces bend it too little
    errors = [ISOTROPIC.reduced(k, PLACES, "modal").error().steady for k in (2, 4, 6)]
    assert errors[0] > errors[1] > errors[2]


def test_modes_at_rest_miss_what_the_spin_does():
    """The error says so."""
    at_rest = ISOTROPIC.reduced(3, PLACES)
    assert at_rest.error().response < 1e-3
    assert at_rest.error(speed=FAST).response > 0.1
    assert at_rest.error(speed=FAST).frequency == pytest.approx(0.0034, rel=0.05)


def test_error_is_that_of_the_plants():
    """The same difference, once more from the state-space models."""
    few = ISOTROPIC.reduced(2, [0.5], "modal")
    at = {"loads": {"d": 0.5}, "actuators": {"d": 0.5}}
    lost = few.error(band_hz=30.0)
    s = 2 * np.pi * lost.response_hz * (1j + 0.01)
    whole, own = (p.open_loop(s) for p in (ISOTROPIC.plant(**at), few.plant(**at)))
    gap = np.linalg.norm(whole[:2, :2] - own[:2, :2], 2) / np.linalg.norm(whole[:2, :2], 2)
    assert gap == pytest.approx(lost.response, rel=1e-6)


def test_nothing_reduced_loses_nothing():
    whole = ISOTROPIC.reduced(None, PLACES)
    assert whole.error().response == 0.0
    assert whole.bases is None
    assert "relative error" in repr(ISOTROPIC.reduced(2, PLACES))
    lines = ISOTROPIC.reduced(2, PLACES).plot(band_hz=50.0).lines
    assert [line.get_label() for line in lines][1] == "what is lost"


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ((0, PLACES), "modes"),
        ((2.5, PLACES), "modes"),
        ((2, []), "ports"),
        ((2, [np.nan]), "ports"),
        ((2, PLACES, "guyan"), "method"),
        ((2, PLACES, "modal", "fast"), "speed"),
    ],
)
def test_what_cannot_be_reduced(arguments, key):
    with pytest.raises(InvalidInputError) as caught:
        ISOTROPIC.reduced(*arguments)
    assert caught.value.key[0] == key
    with pytest.raises(InvalidInputError, match="band_hz"):
        ISOTROPIC.reduced(2, PLACES).error(band_hz=0.0)
