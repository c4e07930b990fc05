"""The thesis's analysis inequalities agree with the other norms, and their proofs hold."""

import control
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.linear.norms.lmi import h2_norm_lmi, hinf_norm_lmi, lyapunov_lmi
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing


def system(seed, feedthrough=0.0):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.05) * np.eye(n)
    units, rate = 10.0 ** rng.uniform(-4, 4, n), 10.0 ** rng.uniform(-6, 6)
    B, C = rng.standard_normal((n, 2)), rng.standard_normal((2, n))
    return control.StateSpace(
        A * units / units[:, None] * rate,
        B / units[:, None] * rate,
        C * units,
        feedthrough * rng.standard_normal((2, 2)),
    )


@pytest.mark.parametrize("equation", ["10.17", "10.44"])
@pytest.mark.parametrize("seed", range(4))
def test_hinf_norms_agree(seed, equation):
    G = system(seed, feedthrough=seed % 2)
    check = hinf_norm_lmi(G, equation=equation)
    norm = hinf_norm(G)
    assert check.verified
    assert norm.lower <= check.value <= norm.value * (1 + 1e-4)
    assert check.optimum == pytest.approx(norm.value, rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_h2_norms_agree(seed):
    check, norm = h2_norm_lmi(system(seed)), h2_norm(system(seed))
    assert check.verified
    assert norm.lower <= check.value <= norm.value * (1 + 1e-4)


@pytest.mark.parametrize("dissipation", [0.01, 0.001])
def test_the_open_loop_of_the_thesis(dissipation):
    G = air_bearing(AirBearingParameters.as_published(), dissipation=dissipation).open_loop
    hinf, h2 = hinf_norm_lmi(G), h2_norm_lmi(G)
    assert hinf.verified
    assert h2.verified
    assert hinf.value == pytest.approx(hinf_norm(G).value, rel=1e-4)
    assert h2.value == pytest.approx(h2_norm(G).value, rel=1e-4)
    assert lyapunov_lmi(G)


def test_the_matrices_hold_in_the_units_given():
    G = system(1)
    K = hinf_norm_lmi(G).matrix
    gamma = hinf_norm_lmi(G).value * 1.0001
    T = 1 / np.sqrt(np.diag(K))  # even units, so that eigenvalues mean something
    A, B, C, K = G.A * T / T[:, None], G.B / T[:, None], G.C * T, K * T * T[:, None]
    rows = np.block([[A.T @ K + K @ A + C.T @ C, K @ B], [B.T @ K, -(gamma**2) * np.eye(2)]])
    weights = 1 / np.sqrt(abs(np.diag(rows)))
    assert np.linalg.eigvalsh(rows * weights * weights[:, None]).max() < 0
    check = h2_norm_lmi(G)
    P = check.matrix
    assert np.trace(G.C @ np.linalg.solve(P, G.C.T)) < check.value * (1 + 1e-9)


def test_unstable_systems_have_no_proof():
    G = control.ss([[1.0]], [[1.0]], [[1.0]], 0)
    assert not lyapunov_lmi(G)
    assert not hinf_norm_lmi(G)
    assert hinf_norm_lmi(G).value == np.inf
    assert not h2_norm_lmi(G)


def test_bad_input_is_refused():
    with pytest.raises(InvalidInputError, match="discrete"):
        hinf_norm_lmi(control.ss([[0.5]], [[1]], [[1]], 0, 0.1))
    with pytest.raises(InvalidInputError, match=r"system\.D"):
        h2_norm_lmi(control.ss([[-1]], [[1]], [[1]], 1))
    with pytest.raises(InvalidInputError, match="equation"):
        hinf_norm_lmi(system(0), equation="10.16")
