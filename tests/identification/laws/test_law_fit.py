import numpy as np
import pytest

from robustpolish.identification.fit.parameters import (
    free_parameters,
    joint_priors,
    parameters_within_laws,
)
from robustpolish.identification.policy import POLICY
from robustpolish.identification.structure.spline_laws import (
    LEARNING,
    mean_log_error,
    with_halved_spacing,
)
from robustpolish.machines.effects.spline_law import coefficients_of, spline_basis
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from tests.effects.learned_curves import learned_law_of
from tests.identification.oscillators import PLACE, oscillator


@pytest.mark.parametrize("over", ["stiffness", "damping", "varying_stiffness", "varying_damping"])
def test_closer_knots_draw_the_same_curve(over):
    law = learned_law_of(lambda x: 90 * x**3 - x, count=11, over=over, at=PLACE).effect
    law = law.with_parameters(roughness=2.0)
    finer = with_halved_spacing(law, -1.1, 1.0)
    assert finer.kind == f"learned_{over}_19"
    assert finer.values["roughness"] == pytest.approx(1.0)  # half the step, half the bend
    x = np.linspace(-1.1, 1.0, 77)
    one, other = (
        coefficients_of(e.values)
        @ spline_basis(x, e.values["low"], e.values["high"], n, over != "stiffness")
        for e, n in ((law, 11), (finer, 19))
    )
    np.testing.assert_allclose(one, other, atol=1e-8)


def test_closer_knots_have_an_end():
    many = learned_law_of(lambda x: x, count=LEARNING.closest // 2 + 3).effect
    assert with_halved_spacing(many, -1.1, 1.0) == many
    few = learned_law_of(lambda x: x, count=9).effect
    assert with_halved_spacing(few, 1.0, 1.0) == few


def test_outputs_count_alike():
    assert mean_log_error(np.array([np.e, np.e**3])) == pytest.approx(2.0)


def test_what_a_law_contains_is_not_fitted():
    law = learned_law_of(lambda q: 90 * q**3, count=9, at=PLACE).effect.with_parameters(
        roughness=0.5
    )
    model = oscillator().with_effect(law.kind, law.at, law.values)
    assert parameters_within_laws(oscillator()) == set()
    assert parameters_within_laws(model) == {"spring[0].stiffness"}
    model = model.with_effect("constant_force", "x", {"force": 1.0})
    assert parameters_within_laws(model) == {"spring[0].stiffness", "effect[1].force"}
    keys = [f.key for f in free_parameters(model, 10.0, POLICY)]
    assert "spring[0].stiffness" not in keys
    assert "effect[1].force" not in keys
    assert "damper[0].damping" in keys
    assert {f"effect[0].c{j}" for j in range(1, 10)} <= set(keys)
    damper = learned_law_of(lambda v: v, count=9, over="damping", at=PLACE).effect
    both = model.with_effect(damper.kind, damper.at, damper.values)
    assert "damper[0].damping" in parameters_within_laws(both)


@pytest.mark.parametrize(
    ("over", "key"), [("stiffness", "spring[0].stiffness"), ("damping", "damper[0].damping")]
)
def test_what_varies_contains_what_stays(over, key):
    law = learned_law_of(lambda t: 5 * t, low=0.0, over=f"varying_{over}", count=9, at=PLACE).effect
    model = oscillator().with_effect(law.kind, law.at, law.values)
    model = model.with_effect("constant_force", "x", {"force": 1.0})
    assert parameters_within_laws(model) == {key}


def test_what_is_known_of_a_law_is_its_bending():
    law = learned_law_of(lambda q: 90 * q**3, count=9, at=PLACE).effect.with_parameters(
        roughness=0.5
    )
    model = oscillator().with_effect(law.kind, law.at, law.values)
    free = free_parameters(model, 10.0, POLICY)
    rows = joint_priors(model, free)
    values = np.array([f.start for f in free])
    wanted = np.diff(coefficients_of(law.values), 2) / 0.5
    np.testing.assert_allclose(rows @ values, wanted, atol=1e-9)
    assert joint_priors(oscillator(), free_parameters(oscillator(), 10.0, POLICY)).size == 0
    # beside a spring law, one over the velocity has no force at rest
    damper = learned_law_of(
        lambda v: 5 * v + 1, count=9, over="damping", at=PLACE, share=0.0
    ).effect
    both = model.with_effect(damper.kind, damper.at, damper.values)
    free = free_parameters(both, 10.0, POLICY)
    last = joint_priors(both, free)[-1]
    found = float(last @ np.array([f.start for f in free]))
    largest = np.max(np.abs(coefficients_of(damper.values)))
    assert found == pytest.approx(1.0 / (1e-3 * largest), rel=1e-3)


@pytest.mark.parametrize(("quantity", "rows"), [("displacement", 7), ("velocity", 8)])
def test_where_no_sensor_shows_a_displacement_it_is_counted_from_rest(quantity, rows):
    """A constant force and another place to count from are one motion."""
    law = learned_law_of(lambda q: 90 * q**3 + 2, count=9, at=PLACE, share=0.0).effect
    law = law.with_parameters(roughness=0.5)
    seen = oscillator(outputs=[Output("y", PLACE, quantity)])
    model = seen.with_effect(law.kind, law.at, law.values)
    free = free_parameters(model, 10.0, POLICY)
    known = joint_priors(model, free)
    assert len(known) == rows
    if rows == 8:
        found = float(known[-1] @ np.array([f.start for f in free]))
        largest = np.max(np.abs(coefficients_of(law.values)))
        assert found == pytest.approx(2.0 / (1e-3 * largest), rel=1e-3)


@pytest.mark.parametrize(
    ("seen", "place", "held"),
    [("a", ("b", "a"), True), ("b", ("b", "a"), False), ("a", ("a", "ground"), False)],
)
def test_a_force_between_two_masses_shows_at_rest_in_the_outer_one_alone(seen, place, held):
    model = MechanicalModel(
        [Dof("a", 1.0), Dof("b", 1.0)],
        [Spring(("a", "ground"), 50.0), Spring(("b", "a"), 20.0)],
        [Damper(("a", "ground"), 1.0), Damper(("b", "a"), 1.0)],
        [Input("f", ("b", "ground"))],
        [Output(seen, (seen, "ground")), Output("acc", ("b", "ground"), "acceleration")],
    )
    law = learned_law_of(lambda q: 90 * q**3 + 2, count=9, at=place).effect.with_parameters(
        roughness=0.5
    )
    model = model.with_effect(law.kind, law.at, law.values)
    rows = joint_priors(model, free_parameters(model, 10.0, POLICY))
    assert len(rows) == 7 + held
