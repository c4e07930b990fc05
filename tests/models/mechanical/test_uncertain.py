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
