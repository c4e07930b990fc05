import pytest

from robustpolish.identification.structure.spline_laws import better_shape
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.discover.searches import prepared_of

PLACE = ("x", "ground")


def told(truth, size, kind, values, at=PLACE):
    """What is said of a record with one effect, and a model with another or the same."""
    case = Case("shape", one(), [(truth, PLACE, [size])], drive=8.0, samples=3000)
    model = model_of(case).with_effect(kind, at, values)
    return better_shape(model, prepared_of(model, records(case)[0][0]))


@pytest.mark.parametrize(
    ("kind", "values"),
    [("cubic_stiffness", {"stiffness": 4e6}), ("quadratic_damping", {"coefficient": 4.0})],
)
def test_the_right_law_needs_no_other_shape(kind, values):
    assert told(kind, *values.values(), kind, values) is None


@pytest.mark.parametrize(
    ("truth", "size", "over"),
    [("fifth_power_stiffness", 1.2e10, "displacement"), ("quadratic_damping", 4.0, "velocity")],
)
def test_a_force_of_another_shape_is_seen(truth, size, over):
    said = told(truth, size, "cubic_stiffness", {"stiffness": 4.3e6})
    assert said is not None
    assert f"A free curve of force over {over} at x, ground" in said


def test_effects_on_signals_have_no_place_for_a_curve():
    assert told("quadratic_damping", 4.0, "input_gain", {"gain": 1.0}, "F_x") is None
