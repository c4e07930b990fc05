import numpy as np
import pytest

import robustpolish as rp


def model():
    return rp.MechanicalModel(
        [rp.Dof("a", 2.0), rp.Dof("b", 1.0), rp.Dof("base", 0.0)],
        [rp.Spring(("a", "base"), 800.0), rp.Spring(("a", "b"), 300.0)],
        [rp.Damper(("a", "b"), 1.5)],
        inputs=[rp.Input("F", ("a", "ground")), rp.Input("q", ("base", "ground"), "displacement")],
        outputs=[
            rp.Output("b", "b"), rp.Output("acc", "a", "acceleration"),
            rp.Output("f", ("a", "b"), "force"),
        ],
        coupled_inertias=[rp.CoupledInertia(("a", "b"), 0.3)],
    )  # fmt: skip


def test_values_are_those_of_the_model():
    ranges = {
        "spring[0].stiffness": 0.1, "spring[1].stiffness": (200, 500), "dof.a.mass": (1.5, 4),
        "dof.b.mass": 0.2, "damper[0].damping": 0.5, "input.F.gain": 0.05,
        "coupled_inertia[0].value": 0.5,
    }  # fmt: skip
    machine = model().uncertain(ranges)
    copies = {block.element.name: block.copies for block in machine.blocks}
    assert copies == dict.fromkeys(ranges, 1) | {"coupled_inertia[0].value": 2}
    values = {
        "spring[0].stiffness": 850.0, "spring[1].stiffness": 480.0, "dof.a.mass": 3.1,
        "dof.b.mass": 1.15, "damper[0].damping": 1.0, "input.F.gain": 0.97,
        "coupled_inertia[0].value": 0.2,
    }  # fmt: skip
    found, wanted = machine.at(values), model().with_parameters(values).state_space()
    for name in "ABCD":
        np.testing.assert_allclose(
            getattr(found, name), getattr(wanted, name), rtol=1e-10, atol=1e-9
        )
    assert found.input_labels == wanted.input_labels
    assert found.state_labels == wanted.state_labels
    np.testing.assert_allclose(machine.nominal.A, model().state_space().A, atol=1e-10)


@pytest.mark.parametrize(
    ("ranges", "says"),
    [
        ({"spring[7].stiffness": 0.1}, "key of model.parameters"),
        ({"spring[0].stiffness": "10 %"}, "share"),
        ({"spring[0].stiffness": rp.uncertain.dynamics("d")}, "uncertain number"),
        ({"spring[0].stiffness": (900, 1000)}, "around the nominal"),
        ({"dof.a.mass": 1.5}, "share below 1"),
        ({"dof.base.mass": 0.1}, "is 0"),
        ({"input.q.gain": 0.1}, "imposed"),
        ([0.1], "mapping"),
    ],
)
def test_bad_ranges(ranges, says):
    with pytest.raises(rp.InvalidInputError, match=says):
        model().uncertain(ranges)


def test_damping_that_may_vanish():
    machine = rp.MechanicalModel(
        [rp.Dof("x", 1.0)], [rp.Spring(("x", "ground"), 1.0)], [rp.Damper(("x", "ground"), 1.0)],
        inputs=[rp.Input("F", ("x", "ground"))], outputs=[rp.Output("x", "x")],
    )  # fmt: skip
    margin = rp.robust_stability(machine.uncertain({"damper[0].damping": (0, 2)}))
    assert margin.upper == pytest.approx(1, abs=1e-9)


KEYS = ("dof.a.mass", "dof.b.mass", "spring[0].stiffness", "damper[0].damping", "input.F.gain")


def test_numbers_of_an_ellipsoid():
    roots = np.tril(np.random.default_rng(0).uniform(0.01, 0.05, (5, 5)))
    known = {key: model().parameters[key] for key in KEYS}
    roots *= np.array(list(known.values()))[:, None]
    fit = rp.uncertain.ellipsoid(known, roots, name="fit")
    machine = model().uncertain({**fit, "spring[1].stiffness": 0.1})
    # A direction occurs as often as the numbers that it moves act in separate ways.
    copies = {block.element.name: block.copies for block in machine.blocks}
    assert copies.pop("spring[1].stiffness") == 1
    assert max(copies.values()) <= 3
    assert copies["fit[4]"] == 1
    np.testing.assert_allclose(machine.nominal.A, model().state_space().A, rtol=1e-9, atol=1e-9)
    point = fit.numbers({"fit[0]": 0.5, "fit[1]": -0.4, "fit[3]": 0.3, "fit[4]": -0.2})
    found = machine.at(point | {"spring[1].stiffness": 320.0})
    wanted = model().with_parameters(point | {"spring[1].stiffness": 320.0}).state_space()
    for name in "ABCD":
        np.testing.assert_allclose(
            getattr(found, name), getattr(wanted, name), rtol=1e-9, atol=1e-8
        )


def test_number_of_a_formula_has_its_own_nominal_value():
    grams = rp.uncertain.real("grams", 2100.0, percent=5)
    machine = model().uncertain({"dof.a.mass": grams / 1000})
    assert list(machine.elements) == ["grams"]
    wanted = model().with_parameters({"dof.a.mass": 2.15}).state_space()
    np.testing.assert_allclose(machine.at({"grams": 2150.0}).A, wanted.A, rtol=1e-10, atol=1e-9)
    own = rp.uncertain.real("dof.a.mass", 2.0, percent=5)
    assert list(model().uncertain({"dof.a.mass": own}).elements) == ["dof.a.mass"]
