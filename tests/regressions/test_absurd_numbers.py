"""Numbers that once ended in errors of NumPy, SciPy, python-control or Python itself."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.systems import named_system
from tests.fuzz.plants import try_plant

# Plants of the fuzz by seed and number that once broke these functions.
DRAWN = [
    (5, 14, "hinf_norm"), (5, 24, "is_detectable"), (5, 89, "prescale"), (5, 99, "controllability"),
    (5, 109, "nu_gap"), (5, 124, "feedback"), (5, 139, "h2_norm"), (5, 169, "given_controller"),
    (5, 259, "ncf_margin"), (5, 283, "nu_gap"), (10, 1529, "h2_norm"), (20, 2699, "largest_period"),
    (20261124, 9, "output_feedback"), (20261124, 49, "observer_feedback"),
    (20261124, 74, "observer_feedback"), (20261124, 242, "state_feedback"),
    (20261123, 604, "loop_analysis"), (22, 7, "robust_output_feedback"),  # the latter was late
    (20261128, 9349, "structured_singular_value"), (20261129, 659, "output_feedback"),
    (20261130, 8328, "cover"), (20261201, 6340, "robust_state_feedback"),
    (20261202, 4809, "singular_values"), (20261202, 5944, "singular_values"),
    (20261204, 384, "output_feedback"),  # this was late, too
    (20261124, 2922, "robust_state_feedback"), (20261124, 8839, "robust_stability"),
]  # fmt: skip
HUGE = (1e160, 1e300, 1e308)
TINY = (1e-160, 1e-310, 5e-324)
NAMES = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")
pytestmark = pytest.mark.usefixtures("overflows_are_expected")


def plant(**matrices):
    """Two states with all that a plant has, but for the given matrices."""
    ordinary = {
        "A": [[-1.0, 2.0], [0.5, -3.0]],
        "B1": [[1.0], [0.3]],
        "B2": [[0.2], [1.0]],
        "C1": [[1.0, 0.4]],
        "C2": [[0.7, 1.0]],
        "D12": [[0.1]],
        "D21": [[0.1]],
    }
    return rp.GeneralizedPlant.from_matrices(**(ordinary | matrices))


def ends_well(function, *arguments, **keywords):
    """Call it; nothing but a result or an error of the package may come."""
    try:
        return function(*arguments, **keywords)
    except rp.RobustPolishError:
        return None


def test_a_single_state_that_nothing_reaches():
    alone = rp.GeneralizedPlant.from_matrices([[-1.0]], [[0.0]], [[0.0]], [[1.0]], [[0.0]])
    for method in (rp.output_feedback, rp.static_output_feedback):
        found = method(alone)
        assert found.certificate.valid
        assert found.certificate.bound == 0.0


def test_a_single_state_without_inputs_is_a_system():
    one = named_system(([[-2.0]], np.zeros((1, 0)), [[1.0]], np.zeros((1, 0))), 0, [], ["y"], ["x"])
    assert (one.nstates, one.ninputs, one.noutputs) == (1, 0, 1)
    assert one.B.shape == (1, 0)
    assert one.D.shape == (1, 0)
    assert one.poles() == [-2.0]


@pytest.mark.shared
def test_loops_that_are_singular_to_rounding_end_a_step_of_a_search(shared):
    with np.load(shared / "data" / "plants" / "static_singular.npz") as given:
        hard = rp.GeneralizedPlant.from_matrices(**{name: given[name] for name in NAMES})
    found = ends_well(rp.static_output_feedback, hard, time_limit=1.0)
    assert found is None or found.certificate.valid


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("value", [*HUGE, *TINY])
def test_one_absurd_matrix(name, value):
    shape = {"A": (2, 2), "B1": (2, 1), "B2": (2, 1), "C1": (1, 2), "C2": (1, 2)}.get(name, (1, 1))
    absurd = plant(**{name: np.full(shape, value)})
    whole = absurd.system
    for function in (rp.hinf_norm, rp.h2_norm, rp.modes, rp.linear.stability,
    rp.linear.scale_system, rp.linear.prescale,
                     rp.linear.controllability, rp.linear.observability,
                     rp.linear.singular_values):  # fmt: skip
        ends_well(function, whole)
    ends_well(rp.certify, absurd, [[-0.1]])
    if value in (1e160, 1e308, 5e-324):
        ends_well(rp.output_feedback, absurd, "h2", "riccati")
        ends_well(rp.state_feedback, absurd, "h2", "riccati", control_weight=0.1)


def test_the_error_names_the_entries_and_says_what_to_do():
    mixed = control.ss([[-1.0]], [[1e-300]], [[1e300]], [[1e300]])
    with pytest.raises(rp.InvalidInputError) as caught:
        rp.hinf_norm(mixed)
    assert "1e-300 (B[0, 0])" in str(caught.value)
    assert "1e+300 (" in str(caught.value)
    assert "units" in str(caught.value)
    with pytest.raises(rp.InvalidInputError, match=r"plant: got entries from .* \(B2\[0, 0\]\)"):
        rp.output_feedback(plant(B2=[[1e200], [1e-200]]))


@pytest.mark.parametrize("rate", [1e-290, 1e-150, 1e150, 1e290])
def test_absurd_units_of_time_are_scaled_away(rate):
    fast = control.ss([[-rate]], [[rate]], [[1.0]], 0)
    norm = rp.hinf_norm(fast)
    assert norm.lower <= 1.0 <= norm.upper <= 1.0 + 1e-8
    assert rp.linear.stability(fast).verdict == "stable"


def test_gains_that_no_double_holds_are_refused_not_rounded():
    for B, C in ((1e-200, 1e-200), (1e200, 1e200)):
        with pytest.raises(rp.InvalidInputError, match="double"):
            rp.hinf_norm(control.ss([[-1.0]], [[B]], [[C]], 0))


def test_growth_beyond_doubles_within_a_period():
    fast = plant(A=[[1e6, 0.0], [0.0, -1.0]])
    with pytest.raises(rp.InvalidInputError, match="period: got 1 s"):
        rp.implementation.plant_at_samples(fast, 1.0)
    with pytest.raises(rp.InvalidInputError, match="period: got 1 s"):
        rp.implementation.certify_sampled(fast, [[0.0]], 1.0)


@pytest.mark.parametrize(("seed", "number", "function"), DRAWN)
def test_plants_that_once_broke_a_function(seed, number, function):
    _, crashes = try_plant(seed, number, [function])
    assert not crashes, str(crashes[0])


def test_signals_that_are_not_there():
    none = plant(B1=np.zeros((2, 0)), D21=np.zeros((1, 0)))
    silent = plant(C1=np.zeros((0, 2)), D12=np.zeros((0, 1)))
    for each in (none, silent):
        for function in (rp.certify, rp.given_controller):
            found = ends_well(function, each, [[0.0]])
            assert found is not None
    unsteered = rp.GeneralizedPlant.from_matrices(
        [[-1.0]], [[1.0]], np.zeros((1, 0)), [[1.0]], [[1.0]]
    )
    assert rp.certify(unsteered, np.zeros((0, 1))).achieved == 1.0
    empty = named_system(([[-1.0]], np.zeros((1, 0)), [[1.0]], np.zeros((1, 0))), 0, [], ["y"], "x")
    for function in (rp.uncertain.ncf_margin, rp.uncertain.nu_gap):
        with pytest.raises(rp.InvalidInputError, match="at least one of each"):
            function(empty, empty)
    with pytest.raises(rp.InvalidInputError, match="at least one of each"):
        rp.uncertain.cover([empty, empty])
    k = rp.uncertain.real("k", 1.0, percent=10)
    unseen = rp.uncertain.series(k, rp.uncertain.system([[-1.0]], [[1.0]], np.zeros((0, 1))))
    with pytest.raises(rp.InvalidInputError, match="at least one of each"):
        rp.worst_case_gain(unseen)


def test_loops_beyond_doubles_are_refused():
    with pytest.raises(rp.InvalidInputError, match="beyond 1e308"):
        plant(B2=[[1e200], [1.0]], C2=[[1e200, 1.0]]).closed_loop([[1.0]])


def test_bounds_stay_true_where_doubles_end():
    # The H2 norm c b / sqrt(2 a) is 1e-310 / sqrt(2e10), where doubles have lost most bits.
    found = rp.h2_norm(control.ss([[-1e10]], [[1e-160]], [[1e-150]], 0))
    assert found.lower == 0.0
    assert 7.1e-316 < found.upper < 1e-307
