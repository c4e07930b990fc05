from dataclasses import replace

import numpy as np
import pytest

from robustpolish.identification.fit.least_squares import (
    homotopy,
    refine_to_minimum,
    residuals_of,
    smoothing_velocity_keys,
    with_original_widths,
    with_rounded_friction,
)
from robustpolish.machines.effects.effect import Effect
from tests.identification.decays.pendulums import AT, decay, pendulum
from tests.identification.discover.searches import prepared_of


@pytest.fixture(scope="module")
def prepared():
    return prepared_of(pendulum(), decay())


@pytest.fixture(scope="module")
def damped():
    model = pendulum().with_effect("coulomb_friction", AT, {"force": 0.1})
    return model.with_effect("quadratic_damping", AT, {"coefficient": 0.02})


def fitted(model, prepared):
    spans = prepared.spans(prepared.everything, 4)
    return homotopy(model, prepared, prepared.everything, pendulum(), spans, 5)[-1]


def test_a_jump_is_rounded_over_the_speed_that_a_step_gains(prepared, damped):
    width = with_rounded_friction(damped, prepared).parameters["effect[1].width"]
    v = prepared.linear_motion.v[0]
    assert 0.1 < width * prepared.runner(damped).substeps / np.abs(np.diff(v)).max() < 1.0
    wide = damped.effects[1].with_values({"force": 0.1, "width": 0.3})
    given = replace(damped, effects=(damped.effects[0], wide, damped.effects[2]))
    assert with_rounded_friction(given, prepared).effects == given.effects
    assert with_rounded_friction(pendulum(), prepared).effects == pendulum().effects


def test_the_minimum_is_reached_where_damped_steps_stop_before(prepared, damped):
    start = fitted(with_rounded_friction(damped, prepared), prepared)
    best = refine_to_minimum(start, prepared, pendulum())
    assert best.rmse <= start.rmse
    assert best.rmse == pytest.approx(1e-3, rel=0.05)
    numbers = best.model.parameters
    assert numbers["effect[1].force"] == pytest.approx(0.15, rel=0.05)
    assert numbers["effect[2].coefficient"] == pytest.approx(0.01, rel=0.1)
    assert best.information.shape == (len(best.free), len(best.free))


def test_it_goes_on_with_the_jumps_that_were_given(prepared, damped):
    held = replace(prepared, held=smoothing_velocity_keys(damped))
    start = fitted(with_rounded_friction(damped, held), held)
    sharp = with_original_widths(start, damped, prepared, pendulum())
    assert sharp.model.parameters["effect[1].width"] == 0.0
    assert sharp.model.parameters["effect[1].force"] == start.model.parameters["effect[1].force"]
    assert sharp.rmse == pytest.approx(start.rmse, rel=0.05)


def test_what_is_held_stays(prepared, damped):
    held = replace(prepared, held=frozenset({"damper[0].damping"}))
    model = damped.with_parameters({"damper[0].damping": 0.0})
    start = fitted(with_rounded_friction(model, held), held)
    best = refine_to_minimum(start, held, pendulum())
    assert best.model.parameters["damper[0].damping"] == 0.0
    assert "damper[0].damping" not in [f.key for f in best.free]
    free = residuals_of(model, start.pieces, prepared, pendulum()).free
    assert "damper[0].damping" in [f.key for f in free]


def test_a_number_that_the_data_press_to_its_bound_ends_on_it(prepared, damped):
    needless = Effect("displacement_dependent_damping", AT, {"coefficient": 1e-3})
    data = decay(drag=0.0, viscous=0.0, coulomb=0.2)
    other = prepared_of(pendulum(), data)
    model = replace(damped, effects=(*damped.effects, needless))
    best = refine_to_minimum(fitted(with_rounded_friction(model, other), other), other, pendulum())
    at_nothing = [best.model.parameters[f"effect[{i}].coefficient"] for i in (2, 3)]
    assert min(at_nothing) == 0.0 or max(at_nothing) < 1e-3


def test_a_fit_is_never_worse_than_where_it_began(prepared, damped):
    best = refine_to_minimum(
        fitted(with_rounded_friction(damped, prepared), prepared), prepared, pendulum()
    )
    again = refine_to_minimum(best, prepared, pendulum())
    assert np.all(again.rmse <= best.rmse)


def test_the_speeds_that_rounding_sets_are_told_by_their_keys():
    assert smoothing_velocity_keys(pendulum()) == frozenset()
    model = pendulum().with_effect("coulomb_friction", AT, {"force": 1.0})
    assert smoothing_velocity_keys(model) == {"effect[1].width"}
    gentle = pendulum().with_effect("coulomb_friction", AT, {"force": 1.0, "width": 0.1})
    assert smoothing_velocity_keys(gentle) == frozenset()  # those that were found are fitted
