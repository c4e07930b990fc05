"""The structured singular value of matrices and systems: by hand, and as SLICOT has it."""

import math

import control
import numpy as np
import pytest

import robustpolish as rp
from tests.reference.examples import servo
from tests.robust.loops import covers

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


def of_loop(loop):
    """M of a loop and its blocks."""
    nw = sum(block.rows for block in loop.blocks)
    nz = sum(block.columns for block in loop.blocks)
    M = loop.interconnection[:nz, :nw]
    return control.ss(M.A, M.B, M.C, M.D, M.dt), list(loop.blocks)


def left_over(M, mu):
    """How singular I - M Delta is at the critical frequency."""
    omega = mu.critical_frequency
    at = np.exp(1j * omega * M.dt) if M.dt else 1j * omega
    value = M.D if np.isinf(omega) else np.atleast_2d(M(at, squeeze=False))
    return np.linalg.svd(np.eye(len(value)) - value @ mu.witness, compute_uv=False)[-1]


def test_one_over_the_margin_of_stability():
    loop = servo()
    M, blocks = of_loop(loop)
    margin, mu = rp.robust_stability(loop), rp.structured_singular_value(M, blocks)
    assert mu.lower == pytest.approx(1 / margin.upper, rel=1e-8)
    assert mu.upper == pytest.approx(1 / margin.lower, rel=1e-8)
    assert mu.proven
    assert mu.status == "bracketed"
    assert covers(mu.intervals)
    assert mu.critical_frequency == pytest.approx(margin.critical_frequency, rel=1e-6)
    assert left_over(M, mu) < 1e-8
    assert "critical frequency" in repr(mu)


@pytest.mark.parametrize("dt", [0, 0.1, True])
def test_one_full_block_is_the_norm(dt):
    random = np.random.default_rng(3)
    A = random.standard_normal((4, 4))
    A = A - (np.linalg.eigvals(A).real.max() + 0.5) * np.eye(4)
    if dt:
        A = 0.8 * A / np.abs(np.linalg.eigvals(A)).max()
    M = control.ss(A, random.standard_normal((4, 3)), random.standard_normal((2, 4)), 0, dt)
    mu, norm = rp.structured_singular_value(M, [("full", (3, 2))]), rp.hinf_norm(M)
    assert mu.lower <= norm.value * (1 + 1e-8)
    assert norm.value * (1 - 1e-8) <= mu.upper <= mu.lower * 1.002
    assert mu.critical_frequency == pytest.approx(norm.frequency, rel=1e-3, abs=1e-6)
    assert left_over(M, mu) < 1e-8


def test_one_real_number_is_exact():
    # s^2 + (1 - d) s + 1 gets unstable at d = 1, which a grid of frequencies misses
    s = control.tf("s")
    mu = rp.structured_singular_value(s / (s**2 + s + 1), [[-1, 0]])
    assert mu.lower == pytest.approx(1, abs=1e-9)
    assert mu.upper == pytest.approx(1, abs=1e-9)
    assert mu.lower <= mu.upper
    assert mu.critical_frequency == pytest.approx(1, rel=1e-6)
    assert mu.witness == pytest.approx(np.ones((1, 1)))


def test_without_states_it_is_that_of_the_matrix():
    D = [[2.0, 2.0], [-1.0, -1.0]]
    mu = rp.structured_singular_value(control.ss([], [], [], D), ["complex", "complex"])
    assert mu.lower == pytest.approx(3, rel=1e-5)
    assert mu.upper == pytest.approx(3, rel=2e-3)
    assert covers(mu.intervals)


def test_statuses():
    unstable = rp.structured_singular_value(control.ss([[1.0]], [[1.0]], [[1.0]], 0), ["real"])
    assert (unstable.status, unstable.lower, unstable.upper) == ("unstable", np.inf, np.inf)
    marginal = rp.structured_singular_value(control.ss([[0.0]], [[1.0]], [[1.0]], 0), ["real"])
    assert marginal.status == "marginal"
    apart = control.ss([[-1.0]], [[0.0, 1.0]], [[1.0], [0.0]], 0)
    zero = rp.structured_singular_value(apart, ["real", "complex"])
    assert (zero.status, zero.lower, zero.upper, zero.proven) == ("zero", 0, 0, True)


def test_bad_input():
    M = control.ss([[-1.0]], [[1.0]], [[1.0]], 0)
    with pytest.raises(rp.InvalidInputError, match="blocks"):
        rp.structured_singular_value(M, ["real", "real"])
    with pytest.raises(rp.InvalidInputError, match="robust_stability"):
        rp.structured_singular_value(servo(), ["real"])
    with pytest.raises(rp.InvalidInputError, match="M"):
        rp.structured_singular_value(control.frd([1.0, 2.0], [1.0, 2.0]), ["real"])


def test_badly_scaled_matrix():
    mu = rp.structured_singular_value([[0.3, 1e6], [1e-8, 0.2j]], ["complex", "complex"])
    assert mu.upper < 0.5


# Bounds over frequency, what blocks cost, and machines at the witness.


s = control.tf("s")
CONTROLLER = 2.3 + 3 / s + 0.38 * s / (0.001 * s + 1)


def pid_loop(percent=40.0, share=0.5):
    """A spring known to some percent, a gain that is off by a share at any frequency, and a PID."""
    k = rp.uncertain.real("k", 10, percent=percent)
    plant = rp.uncertain.system([[0, 1], [-k, -1.8]], [[0], [18]], [[1, 0]])
    plant = plant * (1 + share * rp.uncertain.dynamics("delta"))
    return (plant * CONTROLLER).feedback()


@pytest.fixture(scope="module")
def margin():
    return rp.robust_stability(pid_loop())


def lines(ax):
    return {line.get_label(): np.array(line.get_data()) for line in ax.get_lines()}


def test_curves_stay_below_the_proven_level_and_reach_it(margin):
    drawn = lines(margin.plot())
    below, above = drawn["at least"][1], drawn["at most"][1]
    known = np.isfinite(below)
    assert known.sum() > 20
    assert (below[known] <= above[known] * (1 + 1e-6)).all()
    level = drawn["proven"][1][0]
    assert level == pytest.approx(1 / margin.lower)
    assert np.nanmax(above) <= level
    assert np.nanmax(above) >= 0.995 * level
    mark = drawn["critical frequency"]
    assert mark[0, 0] == pytest.approx(margin.critical_frequency / (2 * math.pi))
    assert mark[1, 0] == pytest.approx(1 / margin.upper)


def test_sensitivity_is_what_a_larger_range_costs(margin):
    shares = margin.sensitivity
    assert sum(shares.values()) == pytest.approx(1.0, abs=0.02)
    # The same loops with one range or the other a tenth larger.
    changed = {
        "k": rp.robust_stability(pid_loop(percent=44.0)),
        "delta": rp.robust_stability(pid_loop(share=0.55)),
    }
    for name, other in changed.items():
        measured = math.log(margin.upper / other.upper) / math.log(1.1)
        assert shares[name] == pytest.approx(measured, abs=0.05)


def test_the_machine_at_the_witness_is_on_the_boundary(margin):
    poles = margin.worst_plant().poles()
    nearest = poles[np.argmin(np.abs(poles - 1j * margin.critical_frequency))]
    assert abs(nearest.real) < 1e-6 * abs(nearest)


def test_the_worst_machine_has_the_worst_gain():
    c = rp.uncertain.real("c", 0.4, percent=50)
    gain = rp.uncertain.complex("gain", 1.0, radius=0.2)
    mass = rp.uncertain.system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]]) * gain
    worst = rp.worst_case_gain(mass)
    machine = worst.worst_plant()
    assert float(rp.hinf_norm(machine)) == pytest.approx(worst.lower, rel=1e-6)
    assert isinstance(worst.witness["gain"], complex)
    drawn = lines(worst.plot())
    assert np.nanmax(drawn["at most"][1]) == pytest.approx(worst.upper, rel=5e-3)
    # A gain is in proportion to 1.2, of which 0.2 are uncertain.
    assert worst.sensitivity["gain"] == pytest.approx(1 / 6, abs=0.02)
    assert set(worst.sensitivity) == {"c", "gain"}


def test_values_of_systems_and_of_matrices():
    M = control.ss([[0, 1], [-4, -0.1]], [[0], [1]], [[1, 0]], 0)
    mu = rp.structured_singular_value(M, ["complex"])
    drawn = lines(mu.plot())
    true = np.abs(M(2j * np.pi * drawn["at most"][0]))
    assert drawn["at most"][1] == pytest.approx(true, rel=1e-4)
    assert mu.sensitivity == {"complex_0": pytest.approx(1.0, abs=1e-4)}
    with pytest.raises(rp.InvalidInputError, match="no loop behind it"):
        rp.structured_singular_value([[1.0]], ["complex"]).plot()


def test_performance_draws_itself_and_without_a_loop_there_is_no_picture():
    error = rp.uncertain.dynamics("error", bound=0.2)
    loop = rp.feedback(control.ss([[-1.0]], [[2.0]], [[1.0]], 0) * (1 + error))
    found = rp.robust_performance(loop, gamma=1.0)
    assert lines(found.plot())["proven"][1][0] == pytest.approx(found.mu[1])
    assert found.worst_plant().nstates >= 1
    c = rp.uncertain.real("c", -1.0, percent=10)
    unstable = rp.robust_stability(rp.uncertain.system([[0, 1], [-1, -c]], [[0], [1]], [[1, 0]]))
    with pytest.raises(rp.InvalidInputError, match="status"):
        unstable.plot()
