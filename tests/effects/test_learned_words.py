import numpy as np
import pytest

from tests.effects.learned_curves import law_of, surface_of


def dead(q):
    return 90 * np.sign(q) * np.maximum(np.abs(q) - 0.3, 0)


@pytest.mark.parametrize(
    ("curve", "over", "said", "unsaid"),
    [
        (lambda q: 90 * q, "stiffness", ("odd", "nearly straight", "slope 89.8"), ("dead zone",)),
        (lambda q: 90 * q**3, "stiffness", ("odd", "hardens"), ("dead zone", "softens")),
        (lambda q: 90 * q**2, "stiffness", ("even",), ("softens", "hardens")),
        (lambda q: 90 * q - 20 * q**3, "stiffness", ("odd", "softens"), ("saturates",)),
        (lambda q: 9 * np.tanh(q / 0.2), "stiffness", ("saturates",), ("hardens",)),
        (dead, "stiffness", ("dead zone from -0.3",), ("hardens",)),
        (lambda q: 90 * np.maximum(q, 0), "stiffness", ("one side only, at positive",), ("odd, ",)),
        (lambda v: 9 * v, "damping", ("takes energy out", "nearly viscous"), ("feeds",)),
        (lambda v: 9 * np.tanh(v / 0.01), "damping", ("dry friction of 9",), ("viscous",)),
        (lambda v: 9 * v * np.abs(v), "damping", ("grows faster",), ("feeds",)),
        (lambda v: 20 * v**3 - 5 * v, "damping", ("feeds energy at speeds from -0.4",), ()),
        (lambda v: -9 * v, "damping", ("feeds energy at every speed",), ("takes",)),
    ],
)
def test_words_fit_the_curve(curve, over, said, unsaid):
    text = law_of(curve, over=over).describe()
    for part in said:
        assert part in text, text
    for part in unsaid:
        assert part not in text, text


def test_numbers_and_place_are_told():
    text = law_of(lambda q: 100 * q**3, low=-1.0).describe()
    assert text.startswith("Force over displacement at x, ground, seen from -1 to 1 m: up to 1")
    assert "standard error is 0." in text
    assert "k3*q**3 with k3 = 1" in text
    assert "No simple formula" in law_of(lambda q: np.sin(8 * q)).describe()


def test_a_surface_is_judged_by_its_energy():
    assert "takes energy out" in surface_of(lambda q, v: 50 * q + 3 * v).describe()
    text = surface_of(lambda q, v: 50 * q - 3 * v).describe()
    assert "feeds energy" in text
    assert "Force over displacement and velocity" in text


@pytest.mark.parametrize(
    ("curve", "said"),
    [
        (lambda t: 40 * t, "rises along the record: from 0"),
        (lambda t: -40 * t, "falls along the record"),
        (lambda t: 40 * np.sin(t), "goes up and down along the record"),
    ],
)
def test_what_varies_with_time_has_a_way(curve, said):
    text = law_of(curve, low=0.0, high=8.0, over="varying_stiffness", share=1e-4).describe()
    assert text.startswith("Stiffness over time at x, ground, seen from 0 to 8 s: up to ")
    assert said in text


def test_warming_up_has_a_formula():
    law = law_of(lambda t: 40 * (1 - np.exp(-t / 2)), low=0.0, high=8.0, over="varying_damping")
    assert "aw*(1 - exp(-t/d)) with aw = 4" in law.describe()
    assert law.formula().numbers["d"] == pytest.approx(2.0, rel=0.1)
