from dataclasses import replace

import numpy as np
import pytest

from robustpolish.identification.observer.kalman import Level
from robustpolish.identification.structure.screening import FilteredRecord
from robustpolish.identification.structure.spline_laws import (
    absorb_own_parameters,
    block,
    dry_friction_block,
    fit_curves,
    with_coefficients,
)
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.spline_law import coefficients_of, spline_basis
from robustpolish.machines.mechanical.data import port_row
from tests.identification.discover.searches import prepared_of
from tests.identification.oscillators import PLACE, oscillator, record


@pytest.fixture(scope="module")
def seen():
    """A record of a cubic spring through the observer of the model without it."""
    model, data = oscillator(), record(cubic=4e4, noise=0.01)
    prepared = prepared_of(model, data)
    motion = prepared.motion(model, prepared.record)
    f = FilteredRecord(model, prepared, prepared.record, Level(0.01), motion)
    return model, f, motion, prepared.record


def test_the_curve_is_in_the_innovations(seen):
    model, f, motion, data = seen
    row = port_row(model, PLACE)
    made = block(model, PLACE, "stiffness", 11, motion, data)
    found = fit_curves(f, row, [made])
    (law,) = found.effects
    q = np.quantile(row @ motion.q, [0.02, 0.1, 0.9, 0.98])
    values, curve = law.values, curve_of(law, q)
    wanted = 4e4 * q**3
    assert np.max(np.abs(curve - wanted)) < 0.15 * np.max(np.abs(wanted))
    assert values["roughness"] > 0
    assert 2 < found.freedom <= 11
    assert found.fall > 0.05
    # over the velocity there is no such force
    other = fit_curves(f, row, [block(model, PLACE, "damping", 11, motion, data)])
    assert other.score > found.score
    both = fit_curves(f, row, [made, block(model, PLACE, "damping", 11, motion, data)])
    assert both.score > found.score
    assert both.score - found.score < 100


def test_dry_friction_may_stand_beside_and_may_not_push(seen):
    model, f, motion, data = seen
    row = port_row(model, PLACE)
    dry = dry_friction_block(model, PLACE, motion)
    found = fit_curves(f, row, [block(model, PLACE, "stiffness", 11, motion, data), dry])
    assert [e.kind for e in found.laws] == ["learned_stiffness_11"]
    (friction,) = found.others
    assert found.sensible == (friction.values["force"] > 0)
    assert abs(friction.values["force"]) < 0.1


def test_where_nothing_moves_there_is_no_curve(seen):
    model, _, motion, data = seen
    still = replace(motion, q=0 * motion.q, v=0 * motion.v)
    assert block(model, PLACE, "stiffness", 11, still, data) is None
    assert dry_friction_block(model, PLACE, still) is None


def test_what_a_fit_made_of_a_spring_moves_into_the_law():
    reference = oscillator()
    fitted = reference.with_parameters(
        {"spring[0].stiffness": 500.0, "damper[0].damping": 3.0, "dof.x.mass": 1.1}
    )
    law = with_coefficients(
        Effect("learned_stiffness_7", PLACE, {"low": -0.1, "high": 0.1}), np.zeros(7)
    )
    model, (moved,) = absorb_own_parameters([law], fitted, reference)
    assert model.parameters["spring[0].stiffness"] == 400.0
    assert model.parameters["damper[0].damping"] == 3.0
    line = curve_of(moved, np.array([-0.05, 0.0, 0.1]))
    np.testing.assert_allclose(line, [-5.0, 0.0, 10.0], atol=1e-12)


def curve_of(law, q):
    """The curve of a law over the displacement."""
    values = law.values
    c = coefficients_of(values)
    return c @ spline_basis(q, values["low"], values["high"], c.size)


def test_a_surface_holds_spring_and_damper():
    reference = oscillator()
    fitted = reference.with_parameters({"spring[0].stiffness": 500.0, "damper[0].damping": 3.0})
    knots = {"low": -0.1, "high": 0.1, "slow": -2.0, "fast": 2.0}
    law = with_coefficients(Effect("learned_force_6x6", PLACE, knots), np.zeros(36))
    model, (moved,) = absorb_own_parameters([law], fitted, reference)
    assert model == reference
    c = coefficients_of(moved.values)
    assert np.ptp(np.diff(c, 2, axis=0)) < 1e-9
    assert c[-1, 0] - c[0, 0] == pytest.approx(100.0 * 0.2 * 5 / 3)
    assert c[0, -1] - c[0, 0] == pytest.approx(2.0 * 4 * 5 / 3)


def test_what_varies_is_followed_along_the_record():
    model, data = oscillator(), record(drift=12.0, noise=0.01)
    prepared = prepared_of(model, data)
    motion, time = prepared.motion(model, prepared.record), prepared.record.time
    f = FilteredRecord(model, prepared, prepared.record, Level(0.01), motion)
    row = port_row(model, PLACE)
    made = {
        over: fit_curves(f, row, [block(model, PLACE, over, 11, motion, prepared.record)])
        for over in ("varying_stiffness", "varying_damping", "stiffness")
    }
    best = min(made, key=lambda over: made[over].score)
    assert best == "varying_stiffness"
    (law,) = made[best].effects
    grid = np.quantile(time, [0.1, 0.5, 0.9])
    values = law.values
    shown = coefficients_of(values) @ spline_basis(grid, values["low"], values["high"], 11, True)
    np.testing.assert_allclose(shown, 12.0 * grid, atol=0.15 * 12.0 * time[-1])


def test_what_a_fit_made_of_a_spring_stays_for_all_time_in_what_varies():
    reference = oscillator()
    fitted = reference.with_parameters({"spring[0].stiffness": 500.0, "damper[0].damping": 3.0})
    for over, key, more in (
        ("stiffness", "spring[0].stiffness", 100.0),
        ("damping", "damper[0].damping", 3.0 - reference.parameters["damper[0].damping"]),
    ):
        law = Effect(f"learned_varying_{over}_7", PLACE, {"low": 0.0, "high": 9.0})
        model, (moved,) = absorb_own_parameters([law], fitted, reference)
        assert model.parameters[key] == reference.parameters[key]
        np.testing.assert_allclose(coefficients_of(moved.values), more)


def test_what_varies_does_so_over_the_whole_record_though_a_part_of_it_is_screened(seen):
    model, _, motion, data = seen
    part = data.part(1000, 3000)
    here = replace(motion, q=motion.q[:, 1000:3000], v=motion.v[:, 1000:3000])
    made = block(model, PLACE, "varying_stiffness", 8, here, part)
    assert (made.effect.values["low"], made.effect.values["high"]) == (0.0, data.times[-1])
    assert made.columns.shape == (8, 1, 2000)


def test_a_curve_is_within_the_sum_of_it_and_another(seen):
    model, f, motion, data = seen
    row = port_row(model, PLACE)
    spring, damper = (
        block(model, PLACE, over, 8, motion, data) for over in ("stiffness", "damping")
    )
    one, other, both = (fit_curves(f, row, each) for each in ([spring], [damper], [spring, damper]))
    assert one.within(both)
    assert other.within(both)
    assert not both.within(one)
    assert not one.within(other)
