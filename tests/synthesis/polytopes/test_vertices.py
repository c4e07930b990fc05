"""Vertices of lists and boxes, and whether these are the mixtures of their corners."""

import numpy as np
import pytest
from polytope_examples import held_mass

import robustpolish as rp
from robustpolish.synthesis.scheduled.polytope import (
    affine_warps,
    polytope,
    scaled_vertices,
    shrunk_matrices,
)

k = rp.uncertain.real("k", 5.0, range=(1.0, 9.0))
m = rp.uncertain.real("m", 1.0, percent=50)
B = [[0, 0], [1, 1]]


def spring_mass(stiffness, mass=1.0):
    return rp.uncertain.system(
        [[0, 1], [-stiffness / mass, -0.1 / mass]], [[0, 0], [1 / mass, 1 / mass]], [[1, 0]], 0
    )


@pytest.mark.parametrize(
    ("system", "known"),
    [
        (spring_mass(k), True),
        # Affine in k and in 1 / m, the other held.
        (spring_mass(k, m), True),
        # A nominal value beside the middle is a fraction of the delta, and the number itself.
        (spring_mass(rp.uncertain.real("k", 2.0, range=(1.0, 9.0))), True),
        (spring_mass(k * k), False),
        (spring_mass(k + 1 / k), False),
    ],
)
def test_mixtures_of_corners(system, known):
    bends = affine_warps(system.matrices)
    assert (bends is not None) == known
    if not known:
        return
    whole = polytope(system, 1, None)
    # The weights of a point inside, by the bent numbers: the plant there is that mixture.
    random = np.random.default_rng(1)
    for _ in range(5):
        elements = list(system.elements.values())
        values = {e.name: random.uniform(e.low, e.high) for e in elements}
        weights = whole.weights(values)
        assert weights.sum() == pytest.approx(1)
        assert (weights >= 0).all()
        mixed = sum(w * p.A for w, p in zip(weights, whole.plants, strict=True))
        assert mixed == pytest.approx(np.asarray(system.at(values).A), abs=1e-12)


def test_corners_are_named_with_their_numbers():
    whole = polytope(spring_mass(k, m), ["u[1]"], None, control_weight=0.3)
    assert len(whole.plants) == 4
    assert whole.plants[0].nu == 1
    assert whole.names[0] == "m = 0.5, k = 1" or whole.names[0] == "k = 1, m = 0.5"
    assert whole.plants[0].performance_names[-1] == "price_u[1]"
    assert whole.system.output_labels[-1] == "price_u[1]"
    assert pytest.approx(whole.plants[2].system.D) == whole.system.at(dict(whole.points[2])).D


def test_units_are_undone_exactly():
    whole = polytope([held_mass(1e6, 1e-3), held_mass(4e6, 1e-3)], None, None).with_full_state()
    scaled, vertices = scaled_vertices(whole)
    assert np.abs(vertices[0].A).max() < 20
    A = vertices[1].A * scaled.state[:, None] / scaled.state / scaled.time
    assert np.array_equal(A, whole.plants[1].A)
    middle = shrunk_matrices(vertices, 0.0)
    assert np.array_equal(middle[0].A, middle[1].A)


def test_refusals():
    with pytest.raises(rp.InvalidInputError, match=r"plant\[1\]: got nw = 2"):
        one = held_mass(1.0)
        more = one.replace(B1=np.eye(2), D11=np.zeros((2, 2)), disturbances=["a", "b"])
        polytope([one, more], None, None)
    with pytest.raises(rp.InvalidInputError, match="controls"):
        polytope(spring_mass(k), None, None)
    with pytest.raises(rp.InvalidInputError, match="real numbers only"):
        polytope(spring_mass(k) * (1 + 0.1 * rp.uncertain.dynamics("d", 2)), 1, None)
    with pytest.raises(rp.InvalidInputError, match="no choice of signals"):
        polytope([held_mass(1.0)], 1, None)
    with pytest.raises(rp.InvalidInputError, match="list of GeneralizedPlant"):
        polytope(held_mass(1.0), None, None)
