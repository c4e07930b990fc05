"""Modal forms as compiled code reads them."""

import numpy as np
import pytest

from robustpolish.linear.eigen import eigensystem
from robustpolish.linear.norms.modal_form import modal_arrays, modal_form
from tests.analysis.norms.random_models import model


@pytest.mark.parametrize("proven", [True, False])
def test_two_doubles_hold_the_imaginary_parts(proven):
    G = model(3)
    form = modal_form(G, eigensystem(G.A), proven)
    modes = modal_arrays(form)
    wide = modes.high.astype(np.longdouble) + modes.low
    assert np.abs(wide - form.imag).max() <= 1e-19
    assert (np.abs(modes.low) <= np.spacing(np.abs(modes.high))).all()
    assert modes.coupling.shape == ((6, 6) if proven else (1, 6))
    np.testing.assert_allclose(
        modes.coupling.sum(axis=1) if proven else modes.coupling[0], form.rows, rtol=1e-8
    )
