"""Blocks on plants: names, shared numbers, refusals."""

import control
import numpy as np
import pytest
from three_loops import blocks, plant

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.synthesis.structured.block_wiring import place_blocks


def test_names_are_different_and_tell_the_signal():
    placement = place_blocks(
        [rp.tunable.pid("x", "F"), rp.tunable.pid("x", "F"), rp.tunable.pid("x", "M")], plant()
    )
    assert [s.name for _, _, s in placement.places] == ["pid_x", "pid_x_F", "pid_x_M"]
    named = place_blocks(
        [rp.tunable.pid("x", "F", name="inner"), rp.tunable.pid("x", "F")], plant()
    )
    assert [s.name for _, _, s in named.places] == ["inner", "pid_x"]


def test_mask_and_shared_numbers():
    placement = place_blocks(blocks(), plant())
    assert placement.mask.tolist() == [[True, False, True], [True, True, True]]
    assert [n.key for n in placement.numbers].count("k") == 1


def test_one_measurement_and_one_control_need_no_names():
    P = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    (block,) = place_blocks(rp.tunable.pid(), P).blocks
    assert (block.measurements, block.controls) == (P.measurement_names, P.control_names)


def idle():
    P = plant()
    return P.replace(B2=P.B2 * [1.0, 0.0], D12=P.D12 * [1.0, 0.0], D22=P.D22 * [1.0, 0.0])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([], "at least one block"),
        (None, "blocks to be tuned"),
        ([3], "a block, such as"),
        ([rp.tunable.pid("y", "F")], "measurement: got 'y', expected one of x, v, p"),
        ([rp.tunable.pid("x", "G")], "control: got 'G', expected one of F, M"),
        ([rp.tunable.pid("x")], "control: got no name"),
        ([rp.tunable.pid(["x", "v"], "F")], "a pid from 2 to 1 signals"),
        (
            [rp.tunable.pid("x", "F", name="a"), rp.tunable.pid("v", "F", name="a")],
            "a name of its own",
        ),
        (
            [
                rp.tunable.pid("x", "F", Kp=rp.tunable.tunable("k", low=0.0)),
                rp.tunable.pid("v", "F", Kp=rp.tunable.tunable("k")),
            ],
            "one meaning of k",
        ),
        ([rp.tunable.pid("x", "F", "P", Kp=1.0)], "a number to be tuned"),
    ],
)
def test_refuses(given, words):
    with pytest.raises(InvalidInputError, match=words):
        assert place_blocks(given, plant()).numbers


def test_refuses_blocks_without_effect():
    with pytest.raises(InvalidInputError, match="drives M, which moves nothing"):
        place_blocks([rp.tunable.pid("x", "M")], idle())


def test_discrete_plants_take_what_means_the_same_there():
    sampled = control.StateSpace(0.5 * np.eye(1), [[1.0]], [[1.0]], 0, 0.1)
    P = rp.GeneralizedPlant.from_loop(sampled)
    with pytest.raises(InvalidInputError, match=r"call design.discretize\(period\)"):
        place_blocks(rp.tunable.pid(), P)
    assert len(place_blocks(rp.tunable.fixed_order(order=1), P).numbers) == 4
