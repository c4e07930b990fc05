import itertools

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from robustpolish.identification.refit import fit_own_parameters
from robustpolish.identification.structure.evidence import _coefficients, evidence
from robustpolish.identification.structure.screening import candidate_columns
from robustpolish.machines.effects.effect import lookup
from tests.identification.discover.searches import prepared_of
from tests.identification.oscillators import PLACE, RATE, oscillator, record

KINDS = (
    "cubic_stiffness", "quadratic_stiffness", "quadratic_damping", "coulomb_friction",
    "pendulum_gravity", "displacement_dependent_damping",
)  # fmt: skip


def decay(force, samples=2000, noise=0.0, start=0.1):
    """The oscillator of 400 N/m, let go, with one more force."""
    time = np.arange(samples) / RATE

    def rhs(t, s):
        return [s[1], -400 * s[0] - 1.0 * s[1] + force(*s)]

    x = solve_ivp(rhs, (0, time[-1]), [start, 0], t_eval=time, rtol=1e-9, atol=1e-12).y[0]
    x = x + noise * np.std(x) * np.random.default_rng(0).standard_normal(samples)
    return xr.Dataset({"x": ("time", x)}, {"time": time})


def with_resonator(mass, stiffness, damping, samples=2000):
    """The oscillator of 400 N/m, let go with another one on it, seen by a fine integration."""
    time = np.arange(samples) / RATE

    def rhs(t, s):
        pull = stiffness * (s[2] - s[0]) + damping * (s[3] - s[1])
        return [s[1], -400 * s[0] - s[1] + pull, s[3], -pull / mass]

    x = solve_ivp(rhs, (0, time[-1]), [0.1, 0, 0, 0], t_eval=time, rtol=1e-9, atol=1e-12).y[0]
    return xr.Dataset({"x": ("time", x)}, {"time": time})


def looked_at(model, data, kinds=KINDS, span=None, at=PLACE, in_part=False):
    """Singles and pairs by what runs over windows of a refitted model say."""
    prepared = prepared_of(model, data)
    stage = fit_own_parameters(model, prepared).stage
    motion = prepared.motion(stage.model, prepared.screened)
    entries = [
        entry
        for name in kinds
        for entry in candidate_columns(stage.model, lookup(name), at, motion, prepared.screened)
    ]
    span = span or prepared.spans(prepared.trial, 2)[-1] // 2
    return evidence(stage.fit, prepared, entries, span, in_part)


def test_a_free_decay_names_its_cubic_spring():
    """20 % of the force at the beginning."""
    model = oscillator(inputs=[])
    singles, _ = looked_at(model, decay(lambda q, v: -8e3 * q**3, noise=1e-3))
    best, second = singles[:2]
    assert best.places == (("cubic_stiffness", PLACE),)
    assert best.odds > second.odds + 10
    assert best.fall > 0.5
    (effect,) = best.effects
    assert effect.values["stiffness"] == pytest.approx(8e3, rel=0.2)


def test_a_forced_machine_names_its_cubic_spring():
    data = record(3000, cubic=4e5, noise=3e-3)
    singles, _ = looked_at(oscillator(), data)
    best, second = singles[:2]
    assert best.places == (("cubic_stiffness", PLACE),)
    assert best.odds > second.odds + 10
    assert best.effects[0].values["stiffness"] == pytest.approx(4e5, rel=0.2)
    assert [e.odds for e in singles] == sorted((e.odds for e in singles), reverse=True)


def test_friction_and_drag_that_hide_each_other_are_a_pair():
    """Damped by Coulomb friction and by drag: the decay is nearly exponential, as by a damper."""
    model = oscillator(inputs=[])
    data = decay(lambda q, v: -0.2 * np.tanh(v / 2e-3) - 0.26 * v * abs(v), 1000, 1e-3)
    singles, pairs = looked_at(model, data)
    alone = {e.effects[0].kind: e.fall for e in singles}
    best = pairs[0]
    assert {effect.kind for effect in best.effects} == {"coulomb_friction", "quadratic_damping"}
    most = max(alone.get(effect.kind, 0.0) for effect in best.effects)
    assert most < 0.3
    assert 1 - best.fall < 0.6 * (1 - most)
    assert best.odds > 2 * pairs[1].odds > 0
    values = {name: value for effect in best.effects for name, value in effect.values.items()}
    assert values["force"] == pytest.approx(0.2, rel=0.2)
    assert values["coefficient"] == pytest.approx(0.26, rel=0.2)


def test_what_a_model_has_already_does_not_count():
    """Nothing but noise is left: no effect has odds, and the damper's own force is none."""
    singles, pairs = looked_at(oscillator(), record(3000, noise=0.01))
    assert all(e.odds < 10 and e.fall < 0.01 for e in singles)
    assert all(e.odds < 15 and e.fall < 0.02 for e in pairs)


def test_a_force_that_pushes_is_no_friction():
    model = oscillator(inputs=[], damping=2.0)
    singles, _ = looked_at(model, decay(lambda q, v: 0.05 * np.tanh(v / 2e-3)), span=400)
    assert all(e.effects[0].kind != "coulomb_friction" for e in singles)


def test_a_resonator_is_seen_near_its_frequency():
    """Its second coefficient is for screening only: no number of it follows from that."""
    data = with_resonator(0.05, 0.05 * (2 * np.pi * 5) ** 2, 0.05)
    singles, _ = looked_at(oscillator(inputs=[]), data, ["attached_resonator"], at=("x",))
    (found,) = singles
    values = found.effects[0].values
    frequency = np.sqrt(values["stiffness"] / values["mass"]) / (2 * np.pi)
    assert frequency == pytest.approx(5, rel=0.1)
    assert 0 < values["mass"] < 0.2
    assert np.isfinite(found.odds)


def test_no_entries_no_evidence():
    assert looked_at(oscillator(), record(2000, noise=0.01), kinds=()) == ([], [])


def test_coefficients_of_a_wrong_sign_are_left_out_and_the_others_do_what_they_can():
    """Against all choices of which coefficients are zero, on random normal equations."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        count = int(rng.integers(1, 4))
        C, y = rng.standard_normal((20, count)), rng.standard_normal(20)
        signs = rng.integers(-1, 2, count)
        c = _coefficients(C.T @ C, C.T @ y, signs)
        assert np.all(signs * c >= 0)
        least = np.inf
        for kept in itertools.product((False, True), repeat=count):
            other = np.zeros(count)
            other[list(kept)] = np.linalg.lstsq(C[:, list(kept)], y, rcond=None)[0]
            if np.all(signs * other >= 0):
                least = min(least, float(np.sum((y - C @ other) ** 2)))
        assert np.sum((y - C @ c) ** 2) == pytest.approx(least, rel=1e-9)


def test_a_kind_with_a_part_that_pulls_the_wrong_way_is_judged_by_the_rest():
    """Friction that is smaller at rest is none of Stribeck's kind, but as good as Coulomb's."""
    model = oscillator(inputs=[])
    data = decay(lambda q, v: -0.6 * np.tanh(v / 0.02) * (1 - 0.6 * np.exp(-((v / 0.2) ** 2))))
    both = ("coulomb_friction", "stribeck_friction")
    singles, _ = looked_at(model, data, both)
    assert [e.effects[0].kind for e in singles] == ["coulomb_friction"]
    singles, _ = looked_at(model, data, both, in_part=True)
    falls = {e.effects[0].kind: e.fall for e in singles}
    assert set(falls) == {"coulomb_friction", "stribeck_friction"}
    (stribeck,) = (e.effects[0] for e in singles if e.effects[0].kind == "stribeck_friction")
    assert stribeck.values["static_force"] == pytest.approx(stribeck.values["force"])
