"""Tunable blocks: what may be given, series, names, shared numbers, and tuned results."""

import json
import math

import control
import numpy as np
import pytest
from three_loops import plant

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.synthesis.structured.block_parts import TunedBlocks
from robustpolish.synthesis.structured.block_structure import place_blocks

pid, tunable = rp.tunable.pid, rp.tunable.tunable


def test_a_tunable_number_knows_its_limits_as_floats():
    number = tunable("k", 1, low=0, high=2)
    assert number == rp.tunable.Tunable("k", 1.0, 0.0, 2.0)
    assert str(number) == "k, from 1, between 0 and 2"
    assert str(tunable("k", 3, free=False)) == "k, held at 3"
    assert math.isinf(tunable("k").high)


@pytest.mark.parametrize(
    ("given", "argument"),
    [
        ({"name": ""}, "name"),
        ({"name": 3}, "name"),
        ({"name": "k", "low": 2, "high": 1}, "low"),
        ({"name": "k", "low": math.nan}, "low"),
        ({"name": "k", "value": 3, "high": 1}, "value"),
        ({"name": "k", "value": math.inf}, "value"),
        ({"name": "k", "value": "much"}, "value"),
        ({"name": "k", "free": False}, "value"),
        ({"name": "k", "free": 1}, "free"),
    ],
)
def test_a_tunable_number_refuses_what_contradicts(given, argument):
    with pytest.raises(InvalidInputError, match=f"^{argument}: got"):
        tunable(**given)


@pytest.mark.parametrize(
    ("make", "argument"),
    [
        (lambda: pid("x") * pid("v"), "measurement"),
        (lambda: pid("x", "F") * rp.tunable.notch(control="M"), "control"),
        (lambda: pid("x", sign=2), "sign"),
        (lambda: pid("x", sign=True), "sign"),
        (lambda: pid(3), "measurement"),
        (lambda: rp.tunable.static_gain([]), "measurement"),
        (lambda: rp.tunable.static_gain(["x", "x"]), "measurement"),
        (lambda: pid("x", name=""), "name"),
        (lambda: pid("x") * "notch", "blocks"),
        (lambda: pid("x") * control.tf([1.0], [1.0, 0.5], 0.1), "blocks"),
        (lambda: pid("x") * np.eye(2), "blocks"),
        (lambda: pid("x", kind="PX"), "kind"),
        (lambda: pid("x", kind=3), "kind"),
        (lambda: pid("x", kind="P", Ki=1.0), "Ki"),
        (lambda: pid("x", kind="PI", Tf=1.0), "Tf"),
        (lambda: pid("x", Tf=0.0), "Tf"),
        (lambda: pid("x", Tf=math.nan), "Tf"),
        (lambda: pid("x", Tf=True), "Tf"),
        (lambda: pid("x", Tf=tunable("T", -1.0)), "Tf"),
        (lambda: pid("x", Tf=tunable("T", low=-2, high=-1)), "Tf"),
        (lambda: pid("x", Kp="large"), "Kp"),
        (lambda: pid("x", kind="PI", Kp=0, Ki=0), "Kp"),
        (lambda: rp.tunable.lead_lag("x", gain=0), "gain"),
        (lambda: rp.tunable.lead_lag("x", zero_hz=-1.0), "zero_hz"),
        (lambda: rp.tunable.low_pass("x", order=3), "order"),
        (lambda: rp.tunable.low_pass("x", order=True), "order"),
        (lambda: rp.tunable.low_pass("x", order=1, damping=0.7), "damping"),
        (lambda: rp.tunable.low_pass("x", damping=0.01), "damping"),
        (lambda: rp.tunable.low_pass("x", frequency_hz=0), "frequency_hz"),
        (lambda: rp.tunable.notch("x", depth=1.5), "depth"),
        (lambda: rp.tunable.notch("x", depth=-0.1), "depth"),
        (lambda: rp.tunable.notch("x", width=0), "width"),
        (lambda: rp.tunable.fixed_order(order=0), "order"),
        (lambda: rp.tunable.fixed_order(order=1.5), "order"),
        (lambda: rp.tunable.fixed_order(order=True), "order"),
        (lambda: rp.tunable.fixed_order(order=1, feedthrough=0), "feedthrough"),
        (lambda: rp.tunable.static_gain("x", structure=[[0, 0]]), "structure"),
        (lambda: rp.tunable.static_gain("x", structure=[["a", "b"]]), "structure"),
    ],
)
def test_blocks_refuse(make, argument):
    with pytest.raises(InvalidInputError, match=f"^{argument}: got"):
        make()


def idle():
    P = plant()
    return P.replace(B2=P.B2 * [1.0, 0.0], D12=P.D12 * [1.0, 0.0], D22=P.D22 * [1.0, 0.0])


def gain(**given):
    return rp.tunable.static_gain(["x", "v"], "F", **given)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([], "at least one block"),
        (None, "blocks to be tuned"),
        ([3], "a block, such as"),
        ([pid("y", "F")], "measurement: got 'y', expected one of x, v, p"),
        ([pid("x", "G")], "control: got 'G', expected one of F, M"),
        ([pid("x")], "control: got no name"),
        ([pid(["x", "v"], "F")], "a pid from 2 to 1 signals"),
        ([pid("x", "F", name="a"), pid("v", "F", name="a")], "a name of its own"),
        (
            [pid("x", "F", Kp=tunable("k", low=0.0)), pid("v", "F", Kp=tunable("k"))],
            "one meaning of k",
        ),
        ([pid("x", "F", Tf=tunable("k", 1.0)), pid("v", "F", Kp=tunable("k"))], "one meaning of k"),
        ([pid("x", "F", "P", Kp=1.0)], "a number to be tuned"),
        ([gain(structure=[[1, 0, 1]])], "structure: got"),
        ([gain(gain=[[1.0, None, None]])], "gain: got"),
        ([gain(gain=[[0.0, 0.0]])], "gain: got"),
        ([gain(gain=[["a", 1.0]])], r"gain\[0,0\]: got"),
    ],
)
def test_blocks_that_do_not_fit_a_plant_are_refused(given, words):
    with pytest.raises(InvalidInputError, match=words):
        rp.structured_output_feedback(plant(), given)


def test_blocks_without_effect_and_sampled_plants():
    with pytest.raises(InvalidInputError, match="drives M, which moves nothing"):
        rp.structured_output_feedback(idle(), [pid("x", "M")])
    sampled = control.StateSpace(0.5 * np.eye(1), [[1.0]], [[1.0]], 0, 0.1)
    with pytest.raises(InvalidInputError, match=r"call design.discretize\(period\)"):
        rp.structured_output_feedback(rp.GeneralizedPlant.from_loop(sampled), pid())


def test_series_take_names_from_either_and_multiply_signs():
    block = rp.tunable.low_pass(control="F", sign=-1) * rp.tunable.notch() * pid("x", sign=-1)
    assert (block.measurements, block.controls, block.sign) == (("x",), ("F",), 1)
    assert repr(-block).startswith("block: F = -low_pass(s) * notch(s) * (Kp")
    filtered = 2.0 * pid("x", kind="P") * control.tf([1.0], [1.0, 1.0])
    assert repr(filtered) == "block: u = 2 * Kp * a given filter of order 1 x"


def test_names_of_blocks_are_different_and_tell_the_signal():
    placement = place_blocks([pid("x", "F"), pid("x", "F"), pid("x", "M")], plant())
    assert [s.name for _, _, s in placement.places] == ["pid_x", "pid_x_F", "pid_x_M"]
    named = place_blocks([pid("x", "F", name="inner"), pid("x", "F")], plant())
    assert [s.name for _, _, s in named.places] == ["inner", "pid_x"]


def tuned():
    numbers = (
        rp.results.TunedNumber("Kp", 2.0, "N/m", "k", 0.0, 2.0, True),
        rp.results.TunedNumber("Ki", 3.0, "N/(m s)", "pid_x.Ki", -math.inf, math.inf, True),
        rp.results.TunedNumber("Tf", 0.1, "s", "pid_x.Tf", 0.1, 0.1, False),
    )
    block = rp.results.TunedBlock("pid_x", "(Kp + Ki/s)", numbers)
    return TunedBlocks((block,), ("F = -(Kp + Ki/s) x",))


def test_tuned_numbers_by_name_and_from_a_file():
    found = tuned()
    assert (list(found), len(found)) == (["pid_x"], 1)
    assert found["pid_x"]["Ki"] == 3.0
    assert found.numbers == {"k": 2.0, "pid_x.Ki": 3.0}
    for missing in (lambda: found["pid"], lambda: found["pid_x"]["Kd"]):
        with pytest.raises(KeyError):
            missing()
    again = TunedBlocks.of_content(json.loads(json.dumps(found.content(), allow_nan=False)))
    assert (again.blocks, again.laws) == (found.blocks, found.laws)


def test_tuned_blocks_show_units_limits_and_shared_names():
    lines = [" ".join(line.split()) for line in repr(tuned()).splitlines()]
    assert lines[2:] == [
        "pid_x Kp = k 2 N/m at its limit",
        "pid_x Ki 3 N/(m s) tuned",
        "pid_x Tf 0.1 s held",
        "F = -(Kp + Ki/s) x",
    ]
    assert "at its limit" in tuned()._repr_html_()
    entries = tuple(
        rp.results.TunedNumber(f"A[{i}]", 1.0, "", f"K.A[{i}]", -1, 1, True) for i in range(20)
    )
    free = TunedBlocks((rp.results.TunedBlock("K", "state space", entries),), ("u = K y",))
    assert repr(free) == "u = K y"
