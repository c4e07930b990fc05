import numpy as np
import pytest

import robustpolish as rp

M = [[2, 2], [-1, -1]]


@pytest.mark.parametrize(
    ("blocks", "value"),
    [
        (["complex", "complex"], 3),
        (["real", "real"], 3),
        ([("complex", 2)], 1),
        ([("real", 2)], 1),
        ([("full", 2)], np.sqrt(10)),
        ([[1, 1], [1, 1]], 3),
        ([[-2, 0]], 1),
        ([[2, 2]], np.sqrt(10)),
    ],
)
def test_by_hand(blocks, value):
    mu = rp.structured_singular_value(M, blocks)
    assert mu.lower == pytest.approx(value, rel=1e-5)
    assert mu.upper == pytest.approx(value, rel=1e-5)
    assert mu.lower <= mu.upper
    assert mu.proven
    assert abs(np.linalg.det(np.eye(2) - M @ mu.witness)) < 1e-9
    assert np.linalg.norm(mu.witness, 2) == pytest.approx(1 / mu.lower)


@pytest.mark.parametrize("seed", range(6))
def test_up_to_three_full_blocks_are_exact(seed):
    random = np.random.default_rng(seed)
    M = random.standard_normal((6, 5)) + 1j * random.standard_normal((6, 5))
    mu = rp.structured_singular_value(M, [("full", (2, 3)), "complex", ("full", (2, 2))])
    assert mu.proven
    assert mu.lower <= mu.upper <= mu.lower * (1 + 1e-4)
    assert np.linalg.svd(np.eye(6) - M @ mu.witness, compute_uv=False)[-1] < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_mixed_structures_do_not_contradict(seed):
    random = np.random.default_rng(50 + seed)
    M = random.standard_normal((5, 5)) + 1j * random.standard_normal((5, 5))
    mu = rp.structured_singular_value(M, [("real", 2), "real", ("full", 2)])
    assert mu.lower <= mu.upper
    delta = mu.witness
    assert np.isrealobj(delta[:3, :3]) or not np.any(delta[:3, :3].imag)
    assert delta[0, 0] == delta[1, 1]


def test_documented_example_of_slicot():
    # of its routine AB13MD, whose upper bound is this; the witness shows that it is the value
    rows = [
        [-1 + 6j, 2 - 3j, 3 + 8j, 3 + 8j, -5 - 9j, -6 + 2j],
        [4 + 2j, -2 + 5j, -6 - 7j, -4 + 11j, 8 - 7j, 12 - 1j],
        [5 - 4j, -4 - 8j, 1 - 3j, -6 + 14j, 2 - 5j, 4 + 16j],
    ]
    M = np.array(rows + rows)
    mu = rp.structured_singular_value(M, ["real", "real", ("full", 2), "complex", "complex"])
    assert mu.upper == pytest.approx(41.74753408, rel=1e-5)
    assert mu.lower <= mu.upper
    assert mu.proven


def test_scaling():
    small = rp.structured_singular_value(1e-9 * np.array(M), ["complex", "real"])
    assert small.upper == pytest.approx(3e-9, rel=1e-5)
    assert rp.structured_singular_value(np.zeros((2, 2)), ["real", "real"]).status == "zero"


@pytest.mark.parametrize(
    "blocks",
    [
        "real",
        [],
        ["half", "real"],
        [("real", 0)],
        [("real", 3)],
        [("full", "a")],
        [3, 4],
        [[-2, 3]],
    ],
)
def test_bad_blocks(blocks):
    with pytest.raises(rp.InvalidInputError, match="blocks"):
        rp.structured_singular_value(M, blocks)


@pytest.mark.parametrize("bad", ["x", [[np.nan]], [[[1]]], None])
def test_bad_matrix(bad):
    with pytest.raises(rp.InvalidInputError, match="M"):
        rp.structured_singular_value(bad, ["real"])
