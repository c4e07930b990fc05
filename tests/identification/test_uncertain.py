"""Uncertain machines and sectors from the covariance of a fit."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from scipy.stats import chi2

import robustpolish as rp
from robustpolish.identification.fit.result import Fitted
from tests.identification.oscillators import PLACE, oscillator, record

KEYS = ("dof.x.mass", "spring[0].stiffness", "damper[0].damping")
DEVIATIONS = np.array([0.01, 6.0, 0.05])


def covariance(*more, deviations=(), keys=KEYS):
    """The covariance of a mass and a spring that err together, a damper, and other numbers."""
    spread = np.concatenate([DEVIATIONS, deviations])
    P = np.diag(spread**2)
    P[0, 1] = P[1, 0] = 0.9 * spread[0] * spread[1]
    names = [*keys, *more]
    return xr.DataArray(P, {"parameter": names, "other": names}, ("parameter", "other"))


def same(found, wanted):
    for name in "ABCD":
        np.testing.assert_allclose(
            getattr(found, name), getattr(wanted, name), rtol=1e-9, atol=1e-9
        )


def machines_in_ellipsoid(model, covariance, confidence, ranges, ports=()):
    fit = SimpleNamespace(model=model, covariance=covariance)
    return Fitted.uncertain(fit, confidence, ranges=ranges, ports=ports)


def test_ellipsoid_is_that_of_the_covariance():
    machine = machines_in_ellipsoid(oscillator(), covariance(), 0.9, None)
    L = np.array(next(iter(machine.elements.values())).directions.slopes)
    np.testing.assert_allclose(L @ L.T, chi2.ppf(0.9, 3) * covariance().values, rtol=1e-9)
    point = {"dof.x.mass": 1.01, "spring[0].stiffness": 406.0, "damper[0].damping": 0.95}
    same(machine.at(point), oscillator().with_parameters(point).state_space())
    assert machine.input_labels == ["F"]


def test_numbers_that_the_data_leave_open_need_a_range():
    known = covariance()
    known.values[2, 2] = np.inf
    with pytest.raises(rp.InvalidInputError, match=r"damper\[0\].damping, which the data do not"):
        machines_in_ellipsoid(oscillator(), known, 0.95, None)
    machine = machines_in_ellipsoid(oscillator(), known, 0.95, {"damper[0].damping": (0.5, 2.0)})
    assert set(machine.elements) == {"fit[0]", "fit[1]", "damper[0].damping"}
    # Two numbers are left, for which the quantile is another one.
    slopes = np.array(machine.elements["fit[0]"].directions.slopes)
    np.testing.assert_allclose(slopes @ slopes.T, chi2.ppf(0.95, 2) * known.values[:2, :2])


def test_mass_that_may_vanish_is_refused():
    known = covariance()
    known.values[0] *= 40
    known.values[:, 0] *= 40
    with pytest.raises(rp.InvalidInputError, match="masses and inertias above 0"):
        machines_in_ellipsoid(oscillator(), known, 0.95, None)


def test_gains_of_signals_are_in_it():
    model = oscillator().with_effect("input_gain", ("F",), {"gain": 1.2})
    model = model.with_effect("sensor_gain", ("x",), {"gain": 0.8})
    known = covariance("effect[0].gain", "effect[1].gain", deviations=(0.03, 0.02))
    point = {"spring[0].stiffness": 404.0, "effect[0].gain": 1.22, "effect[1].gain": 0.79}
    plain = oscillator().with_parameters({"spring[0].stiffness": 404.0})
    certain = machines_in_ellipsoid(
        model, known.isel(parameter=[1, 3, 4], other=[1, 3, 4]), 0.95, None
    )
    found, wanted = certain.at(point), plain.state_space()
    assert found(3j) == pytest.approx(0.79 * 1.22 * wanted(3j), rel=1e-12)
    assert certain.output_labels == ["x"]
    other = {"effect[0].gain": rp.uncertain.real("g", 1.1, percent=5)}
    assert "g" in machines_in_ellipsoid(model, known, 0.95, other).elements
    for share_or_range in (0.1, (1.08, 1.32)):
        machine = machines_in_ellipsoid(model, known, 0.95, {"effect[0].gain": share_or_range})
        element = machine.elements["effect[0].gain"]
        assert (element.low, element.high) == pytest.approx((1.08, 1.32))


def test_forces_of_effects_are_told():
    cubic = oscillator().with_effect("cubic_stiffness", ("x", "ground"), {"stiffness": 1e4})
    late = oscillator().with_effect("input_delay", ("F",), {"delay": 1e-3})
    dry = oscillator().with_effect("coulomb_friction", ("x", "ground"), {"force": 0.1})
    for model, name in ((cubic, "cubic"), (late, "delay"), (dry, "coulomb")):
        with pytest.warns(rp.RobustPolishWarning, match=name):
            machines_in_ellipsoid(model, covariance(), 0.95, None)
    # A force from outside changes nothing of how the machine answers to others.
    machines_in_ellipsoid(
        oscillator().with_effect("constant_force", ("x",), {"force": 3.0}), covariance(), 0.95, None
    )


def test_refit_covers_the_machine_that_was_measured():
    data = record(noise=0.05, seed=3)
    fitted = rp.refit(oscillator(380.0, 1.2), data)
    machine = fitted.uncertain()
    truth = {"dof.x.mass": 1.0, "spring[0].stiffness": 400.0, "damper[0].damping": 1.0}
    known = rp.uncertain.ellipsoid(
        {k: fitted.model.parameters[k] for k in truth},
        covariance=fitted.covariance.sel(parameter=list(truth), other=list(truth)).values,
    )
    assert known.size(truth) < 1
    same(machine.at(truth), oscillator().state_space())
    margin = rp.robust_stability(machine)
    assert margin.robust
    # The nearest machine on the boundary has no damping.
    worst = machine.numbers(margin.witness)
    assert worst["damper[0].damping"] == pytest.approx(0, abs=1e-9)
    assert known.size(worst) >= margin.lower


def test_without_a_covariance_nothing_is_known():
    machine = machines_in_ellipsoid(oscillator(), None, 0.95, {"spring[0].stiffness": 0.1})
    assert list(machine.elements) == ["spring[0].stiffness"]
    with pytest.raises(rp.InvalidInputError, match="a mapping"):
        machines_in_ellipsoid(oscillator(), None, 0.95, 0.1)


def test_ports_open_the_place_of_an_effect():
    model = oscillator().with_effect("cubic_stiffness", ("x", "ground"), {"stiffness": 1e4})
    machine = machines_in_ellipsoid(model, covariance(), 0.95, None, ["effect[0]"])
    assert machine.input_labels == ["F", "effect[0]"]
    assert machine.output_labels == ["x", "effect[0]"]
    # A spring at the port is a spring at the place of the effect.
    closed = machine.feedback(np.diag([0.0, 30.0]))[["x"], ["F"]].nominal
    assert closed(2j) == pytest.approx(oscillator(430.0).state_space()(2j), rel=1e-9)
    with pytest.raises(rp.InvalidInputError, match="a force between two places"):
        machines_in_ellipsoid(model, covariance(), 0.95, None, ["effect[1]"])


def test_ellipsoid_holds_the_truth_as_often_as_it_says():
    truth = {"dof.x.mass": 1.0, "spring[0].stiffness": 400.0, "damper[0].damping": 1.0}
    clean, sizes = record(samples=1200), []
    for seed in range(40):
        noise = np.random.default_rng(100 + seed).standard_normal(clean.time.size)
        shown = clean["x"].values + 0.1 * clean["x"].values.std() * noise
        data = clean.assign(x=("time", shown, {"units": "m"}))
        fitted = rp.refit(oscillator(380.0, 1.2), data)
        known = fitted.covariance.sel(parameter=list(truth), other=list(truth)).values
        centre = {key: fitted.model.parameters[key] for key in truth}
        sizes.append(rp.uncertain.ellipsoid(centre, covariance=known).size(truth))
    inside = np.mean(np.array(sizes) <= 1)
    assert inside >= 0.9
    # Not by being far too large: half of all lie within the radius that holds half of them.
    assert np.median(sizes) > 0.5 * np.sqrt(chi2.ppf(0.5, 3) / chi2.ppf(0.95, 3))


def fitted(kind, values, **errors):
    """A model with an effect whose numbers have errors."""
    model = oscillator().with_effect(kind, PLACE, values)
    keys = [f"effect[0].{name}" for name in errors]
    P = np.diag(np.array(list(errors.values()), dtype=float) ** 2)
    known = xr.DataArray(P, {"parameter": keys, "other": keys}, ("parameter", "other"))
    return SimpleNamespace(model=model, covariance=known)


def test_cube_of_a_number_with_an_error():
    low, high = rp.uncertain.effect_sector(
        fitted("cubic_stiffness", {"stiffness": 2e6}, stiffness=1e5), "effect[0]", 0.01
    )
    # The slope of the chord is k a^2, with k 1.96 standard errors up.
    assert high == pytest.approx((2e6 + 1.959964e5) * 1e-4, rel=1e-6)
    assert 0 < low < 1e-5 * high


def test_softening_spring_and_both_signs():
    low, high = rp.uncertain.effect_sector(
        fitted("cubic_stiffness", {"stiffness": -2e6}, stiffness=2e6), "effect[0]", 0.01, 0.9
    )
    assert low == pytest.approx((-2e6 - 1.644854 * 2e6) * 1e-4, rel=1e-6)
    assert high == pytest.approx((-2e6 + 1.644854 * 2e6) * 1e-4, rel=1e-6)


def test_force_lies_in_its_sector():
    low, high = rp.uncertain.effect_sector(
        fitted("quadratic_stiffness", {"stiffness": 3e4}).model, "effect[0]", 0.02
    )
    q = np.linspace(-0.02, 0.02, 777)
    force = 3e4 * q * q
    assert (low * q**2 - 1e-12 <= force * q).all()
    assert (force * q <= high * q**2 + 1e-12).all()


@pytest.mark.parametrize(
    ("kind", "values", "says"),
    [
        ("coulomb_friction", {"force": 1.0}, "more than the displacement|of one displacement"),
        ("quadratic_damping", {"coefficient": 1.0}, "displacement"),
        ("bouc_wen_hysteresis", {}, "one displacement"),
    ],
)
def test_forces_of_other_things_are_refused(kind, values, says):
    model = oscillator().with_effect(kind, PLACE, values)
    with pytest.raises(rp.InvalidInputError, match=says):
        rp.uncertain.effect_sector(model, "effect[0]", 0.01)


def test_bad_arguments():
    model = fitted("cubic_stiffness", {"stiffness": 2e6}).model
    for call in (
        lambda: rp.uncertain.effect_sector(model, "effect[1]", 0.01),
        lambda: rp.uncertain.effect_sector(model, "spring[0]", 0.01),
        lambda: rp.uncertain.effect_sector(model, "effect[0]", 0.0),
        lambda: rp.uncertain.effect_sector(model, "effect[0]", 0.01, 95),
        lambda: rp.uncertain.effect_sector(3, "effect[0]", 0.01),
        lambda: rp.uncertain.effect_sector(
            fitted("cubic_stiffness", {"stiffness": 2e6}, stiffness=np.inf), "effect[0]", 0.01
        ),
    ):
        with pytest.raises(rp.InvalidInputError):
            call()
