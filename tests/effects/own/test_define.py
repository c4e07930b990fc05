"""Three lines in a notebook: defined, used, found."""

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError, RobustPolishWarning
from robustpolish.machines.effects import effect as catalogue
from robustpolish.machines.effects.effect import Effect, kinds, register, unregister
from robustpolish.machines.effects.kind import EffectKind, Parameter
from robustpolish.machines.effects.user_defined import own_kind, own_table
from robustpolish.machines.simulation.run import simulate_model
from tests import made_up

PLACE = ("x", "ground")


@pytest.fixture(autouse=True)
def nothing_registered(monkeypatch):
    monkeypatch.setattr(catalogue, "_registered", {})


def fifth(**more):
    return rp.effect("f = -k*q**5", parameters={"k": "N/m^5"}, **more)


def test_a_formula_becomes_an_effect():
    kind = fifth()
    assert kinds()["f = -k*q**5"] is kind
    for named in (kind, kind.kind):
        model = made_up.model().with_effect(named, "x", {"k": 3.0})
        assert model.effects[0].values == {"k": 3.0}
        assert model.effects[0].definition is kind
    assert "N/m^5" in str(model)


def test_running_a_cell_again_changes_nothing():
    one = made_up.model().with_effect(fifth(), "x", {"k": 3.0})
    again = made_up.model().with_effect(fifth(), "x", {"k": 3.0})
    assert one == again
    assert list(kinds()).count("f = -k*q**5") == 1


def test_a_changed_formula_replaces_the_former_one_and_leaves_models_alone():
    former = made_up.model().with_effect(fifth(name="law"), "x", {"k": 3.0})
    rp.effect("f = -c*v**3", parameters={"c": "N s^3/m^3"}, name="law")
    assert list(kinds()["law"].linear_in) == ["c"]
    assert former.effects[0].values == {"k": 3.0}
    assert former.with_parameters({"effect[0].k": 4.0}).effects[0].values == {"k": 4.0}
    assert "q**5" in former.to_toml()
    assert made_up.model().with_effect("law", "x", {"c": 1.0}).effects[0].values == {"c": 1.0}


def test_the_catalogue_is_never_replaced():
    with pytest.raises(InvalidInputError, match="Rename"):
        fifth(name="cubic_stiffness")


def test_an_effect_is_withdrawn():
    kind = fifth()
    unregister(kind.kind)
    assert kind.kind not in kinds()
    assert Effect.of(kind, PLACE, {"k": 1.0}).definition == kind
    with pytest.raises(InvalidInputError, match="registered"):
        unregister(kind.kind)
    with pytest.raises(InvalidInputError, match="registered"):
        unregister("cubic_stiffness")


def test_options_are_kept():
    kind = rp.effect(
        "f = -F*abs(v/w)**n*sign(v)",
        parameters={"F": "N", "w": "m/s", "n": "1"},
        name="rim",
        title="Drag at the rim",
        domain="dof",
        bounds={"F": (0, None), "n": (0.5, 3.0)},
        scan={"n": [1.0, 2.0]},
        known={"w": 0.5},
    )
    assert (kind.kind, kind.title, kind.domain) == ("rim", "Drag at the rim", "dof")
    assert [(p.lower, p.upper) for p in kind.parameters] == [
        (0.0, np.inf),
        (-np.inf, np.inf),
        (0.5, 3.0),
    ]
    assert [p.default for p in kind.parameters] == [0.0, 0.5, 1.0]
    assert [p.fitted for p in kind.parameters] == [True, False, True]
    assert {scan.parameter: scan.shares for scan in kind.scan} == {"n": (1.0, 2.0), "w": (0.5,)}
    assert own_kind(own_table(kind)) == kind


def test_a_default_keeps_the_bounds():
    kind = rp.effect("f = -k*q**3", parameters={"k": "N/m^3"}, bounds={"k": (2.0, None)})
    assert kind.parameter("k").default == 2.0


@pytest.mark.parametrize(
    ("formula", "units", "key", "told"),
    [
        ("f = -c*abs(v)**n*sign(v)", {"c": "N", "n": "1"}, ("scan",), "scan={'n'"),
        ("f = -k*q**5", {"k": "N/mm^5"}, ("parameters", "k"), "parameters.k: got 'N/mm^5'"),
        ("f = -k*q**5", {"k": "N/m^3"}, ("formula",), "f comes out in N m^2"),
        ("f = -k*q**5", None, ("formula", "k"), "Declare it"),
    ],
)
def test_errors_teach(formula, units, key, told):
    with pytest.raises(InvalidInputError) as caught:
        rp.effect(formula, parameters=units)
    assert caught.value.key == key
    assert told in str(caught.value)
    assert formula not in kinds()


def test_a_law_that_no_diagnosis_can_try_is_said_to_be_one():
    with pytest.warns(RobustPolishWarning, match="proportional"):
        kind = rp.effect("f = -q/c", parameters={"c": "m/N"})
    model = made_up.model().with_effect(kind, "x", {"c": 0.5})
    assert model.linearize().A[1, 0] == pytest.approx(-(8e4 + 2.0) / 2.0)


def test_other_kinds_have_no_table():
    assert own_table(kinds()["cubic_stiffness"]) is None
    with pytest.raises(InvalidInputError, match="unknown key"):
        own_kind({"formula": "f = -3*q", "kind": "x"})


# By hand and by formula ---------------------------------------------------------------


def cubic(t, q, v, z, p, f, dz):
    f[0] = -p[0] * q[0] ** 3


def drag(t, q, v, z, p, f, dz):
    f[0] = -p[0] * abs(v[0]) * v[0]


def friction(t, q, v, z, p, f, dz):
    f[0] = -p[0] * np.tanh(v[0] / p[1])


def play(t, q, v, z, p, f, dz):
    f[0] = p[0] * min(max(q[0], -p[1]), p[1])


LAWS = {
    "cubic": (cubic, "f = -k*q**3", {"k": "N/m^3"}, {"k": 5e9}),
    "drag": (drag, "f = -c*abs(v)*v", {"c": "N s^2/m^2"}, {"c": 900.0}),
    "friction": (friction, "f = -F*tanh(v/w)", {"F": "N", "w": "m/s"}, {"F": 4.0, "w": 0.02}),
    "play": (play, "f = k*min(max(q, -g), g)", {"k": "N/m", "g": "m"}, {"k": 7e4, "g": 4e-4}),
}


def driven(samples=4000):
    time = np.arange(samples) / 2e3
    rng = np.random.default_rng(8)
    force = sum(
        rng.normal() * np.sin(2 * np.pi * hertz * time + rng.uniform(0, 6))
        for hertz in np.linspace(3, 60, 20)
    )
    return xr.Dataset({"F": ("time", 20 * force, {"units": "N"})}, {"time": time})


@pytest.mark.parametrize("name", LAWS)
def test_a_model_does_the_same_with_a_law_by_hand(name):
    law, formula, units, values = LAWS[name]
    kind = rp.effect(formula, parameters=units)
    parameters = tuple(Parameter(p.name, p.dimension, "") for p in kind.parameters)
    by_hand = register(
        EffectKind("by_hand", "", "pair", parameters, law, gains=kind.gains, sharp=kind.sharp)
    )
    one, other = (made_up.model().with_effect(k, "x", values) for k in (kind, by_hand))
    data = driven()
    found, wanted = (simulate_model(m, data).outputs for m in (one, other))
    without = simulate_model(made_up.model(), data).outputs
    assert np.max(np.abs(wanted - without)) > 0.02 * np.max(np.abs(wanted))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    np.testing.assert_allclose(one.linearize().A, other.linearize().A, rtol=1e-9)


def noisy(model, share=0.005):
    data = driven(6000)
    x = simulate_model(model, data).outputs[:, 0]
    noise = share * x.std() * np.random.default_rng(2).standard_normal(x.size)
    return data.assign(x=("time", x + noise, {"units": "m"}))


def test_it_is_refitted():
    kind = rp.effect("f = -F*tanh(v/w)", parameters={"F": "N", "w": "m/s"})
    true = made_up.model().with_effect(kind, "x", {"F": 8.0, "w": 0.02})
    start = true.with_parameters({"effect[0].F": 5.0, "effect[0].w": 0.03})
    fitted = rp.refit(start, noisy(true)).model.effects[0]
    assert fitted.values["F"] == pytest.approx(8.0, rel=0.02)
    assert fitted.values["w"] == pytest.approx(0.02, rel=0.1)


def test_what_is_known_is_not_fitted():
    kind = rp.effect("f = -F*tanh(v/w)", parameters={"F": "N", "w": "m/s"}, known={"w": 0.02})
    true = made_up.model().with_effect(kind, "x", {"F": 8.0})
    assert true.effects[0].values["w"] == 0.02
    fitted = rp.refit(made_up.model().with_effect(kind, "x"), noisy(true)).model.effects[0]
    assert fitted.values["F"] == pytest.approx(8.0, rel=0.02)
    assert fitted.values["w"] == 0.02


def test_one_that_nobody_registered_gets_its_first_values_from_a_screening():
    """As of a model from a file: no numbers, and no diagnosis knows the kind."""
    true = made_up.model().with_effect(fifth(), "x", {"k": 1e16})
    unregister("f = -k*q**5")
    blank = made_up.model().with_effect(true.effects[0].definition, "x")
    start = rp.MechanicalModel.from_toml(blank.to_toml())
    assert start.effects[0].values == {"k": 0.0}
    fitted = rp.refit(start, noisy(true)).model.effects[0]
    assert fitted.values["k"] == pytest.approx(1e16, rel=0.02)


@pytest.mark.long
def test_a_diagnosis_finds_the_fifth_power_among_the_catalogue(tmp_path):
    kind = fifth()
    true = made_up.model().with_effect(kind, "x", {"k": 1e16})
    found = rp.diagnose(made_up.model(), noisy(true))
    assert [(e.kind, e.at) for e in found.effects] == [(kind.kind, PLACE)]
    assert found.effects[0].parameters["k"].value == pytest.approx(1e16, rel=0.02)
    assert found.effects[0].parameters["k"].unit == "N/m^5"
    found.save(tmp_path / "found.json")
    unregister(kind.kind)
    again = rp.load(tmp_path / "found.json")
    assert again.model == found.model
    assert again.effects == found.effects
    assert again.explain() == found.explain()


# Channels -----------------------------------------------------------------------------


def damper():
    return rp.effect("f = -c*u*v", parameters={"c": "N s/(m V)"}, channels={"u": "V"})


def test_a_channel_is_a_straight_line_between_samples():
    """A ramp of voltage does what a law with the ramp in it does."""
    kind = rp.effect(
        "f = -(a + c*u)*v", parameters={"a": "N s/m", "c": "N s/(m V)"}, channels={"u": "V"}
    )
    ramp = rp.effect("f = -(a + c*(1 + 3*t))*v", parameters={"a": "N s/m", "c": "N s/m"})
    values = {"a": 5.0, "c": 40.0}
    data = driven()
    data = data.assign(u=("time", 1 + 3 * data["time"].values, {"units": "V"}))
    one, other = (made_up.model().with_effect(k, "x", values) for k in (kind, ramp))
    found, wanted = (simulate_model(m, data, substeps=2).outputs for m in (one, other))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


def test_a_model_says_what_an_effect_reads():
    model = made_up.model().with_effect(damper(), "x", {"c": 40.0})
    assert model.channels == ("u",)
    assert model == made_up.model().with_channel("u", "V").with_effect("f = -c*u*v", "x", {"c": 40})
    assert rp.MechanicalModel.from_toml(model.to_toml()) == model
    assert "N s/m/V" in str(model)
    assert "channel" in str(model)
    assert "mass 0" not in " ".join(str(model).split())


def test_it_is_linearised_at_a_voltage():
    model = made_up.model().with_effect(damper(), "x", {"c": 40.0})
    slopes = [model.linearize(operating_point={"u": volt}).A[1, 1] for volt in (0.0, 2.0)]
    np.testing.assert_allclose(slopes, [-12.0 / 2.0, -(12.0 + 80.0) / 2.0])


def test_data_without_the_channel_are_refused():
    model = made_up.model().with_effect(damper(), "x", {"c": 40.0})
    data = driven()
    with pytest.raises(InvalidInputError, match="no column 'u'"):
        rp.compare(model, data.assign(x=data["F"] * 1e-5))


def test_channel_names_that_are_taken_are_refused():
    taken = rp.effect("f = -c*F*v", parameters={"c": "s/m"}, channels={"F": "N"})
    with pytest.raises(InvalidInputError, match="Rename"):
        made_up.model().with_effect(taken, "x", {"c": 1.0})
    with pytest.raises(InvalidInputError, match="no input imposes"):
        itself = rp.effect("f = -c*x*v", parameters={"c": "N s/(m V)"}, channels={"x": "V"})
        made_up.model().with_effect(itself, "x", {"c": 1.0})


def test_a_diagnosis_finds_what_follows_a_voltage():
    kind = damper()
    data = driven(6000)
    volts = 2 + np.sin(2 * np.pi * 0.7 * data["time"].values)
    data = data.assign(u=("time", volts, {"units": "V"}))
    true = made_up.model().with_effect(kind, "x", {"c": 40.0})
    x = simulate_model(true, data).outputs[:, 0]
    noise = 0.005 * x.std() * np.random.default_rng(4).standard_normal(x.size)
    data = data.assign(x=("time", x + noise, {"units": "m"}))
    found = rp.diagnose(made_up.model().with_channel("u", "V"), data)
    assert [(e.kind, e.at) for e in found.effects] == [(kind.kind, PLACE)]
    assert found.effects[0].parameters["c"].value == pytest.approx(40.0, rel=0.02)
    assert not any("u" in c.at for c in found.candidates)
