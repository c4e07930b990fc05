"""Controllers of at most k states: between static and full order, certified, with their bound."""

import numpy as np
import pytest
from published_plants import compleib
from small_plants import oscillator

import robustpolish as rp
from robustpolish.errors import InfeasibleError, InvalidInputError
from robustpolish.plants.plant import GeneralizedPlant


def test_more_states_never_do_worse_and_all_stay_above_the_bound():
    plant = oscillator()
    full = rp.output_feedback(plant)
    found = [rp.output_feedback(plant, order=k, effort=0.2) for k in (0, 1, 2)]
    norms = [design.certificate.achieved for design in found]
    for k, design in enumerate(found):
        assert design.certificate.valid
        assert design.controller.nstates <= k
        assert design.lower_bound == pytest.approx(full.lower_bound, rel=1e-6)
        assert design.certificate.achieved >= full.lower_bound * (1 - 1e-6)
        assert f"{k} state" in design.message or f"of the {k} states" in design.message
    assert norms[0] >= norms[1] * (1 - 1e-4)
    assert norms[1] >= norms[2] * (1 - 1e-4)
    assert norms[2] <= full.certificate.achieved * 1.004
    # A static gain is what static output feedback finds.
    static = rp.static_output_feedback(plant)
    assert norms[0] == pytest.approx(static.certificate.achieved, rel=1e-3)


def test_the_limit_counts_the_states_of_all_decoupled_parts():
    one = oscillator()
    both = GeneralizedPlant.from_matrices(
        *(np.kron(np.eye(2), M) for M in (one.A, one.B1, one.B2, one.C1, one.C2)),
        D12=np.kron(np.eye(2), one.D12),
        D21=np.kron(np.eye(2), one.D21),
    )
    design = rp.output_feedback(both, order=1, effort=0.02)
    assert design.certificate.valid
    assert design.controller.nstates <= 1


@pytest.mark.parametrize(
    ("given", "argument"),
    [
        ({"order": -1}, "order"),
        ({"order": 1.5}, "order"),
        ({"order": True}, "order"),
        ({"order": "two"}, "order"),
        ({"order": 1, "method": "lmi"}, "method"),
        ({"order": 1, "gamma": 3.0}, "gamma"),
        ({"order": 1, "effort": 0.0}, "effort"),
        ({"order": 1, "time_limit": -1.0}, "time_limit"),
    ],
)
def test_refuses_what_makes_no_sense(given, argument):
    with pytest.raises(InvalidInputError, match=rf"^{argument}"):
        rp.output_feedback(oscillator(), **given)


def test_a_fixed_mode_is_refused_for_every_order():
    plant = GeneralizedPlant.from_matrices(
        [[1.0, 0.0], [0.0, -1.0]], [[1.0], [1.0]], [[0.0], [1.0]], [[1.0, 1.0]], [[1.0, 1.0]]
    )
    with pytest.raises(InfeasibleError):
        rp.output_feedback(plant, order=1)


# What the search reached, with 3 % of room, and what it had reached without reduced full-order
# designs and shorter controllers to start from.
REACHED = {("DLR3", 2): (560.0, 1619.0), ("HE6", 2): (47.5, 146.0), ("IH", 0): (1e-4, 1.59)}


@pytest.mark.long
@pytest.mark.shared
@pytest.mark.parametrize(("name", "order"), REACHED)
def test_plants_of_twenty_to_forty_states(shared, name, order):
    design = rp.output_feedback(compleib(shared, name), order=order)
    assert design.certificate.valid
    assert design.controller.nstates <= order
    assert design.certificate.achieved <= REACHED[name, order][0]
