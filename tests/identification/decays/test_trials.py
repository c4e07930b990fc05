import numpy as np
import pytest

from robustpolish.identification.structure.decays import DampingFits, damping_laws, split_decays
from tests.identification.decays.pendulums import AT, decay, pendulum
from tests.identification.discover.searches import prepared_of

# in the order of the laws of `trials`
COULOMB, SHAPE, DRAG, OWN = range(4)


@pytest.fixture(scope="module")
def trials():
    """Coulomb friction and drag; what was found is Coulomb friction and another damping."""
    prepared = prepared_of(pendulum(), decay())
    model = pendulum().with_effect("coulomb_friction", AT, {"force": 0.1})
    model = model.with_effect("displacement_dependent_damping", AT, {"coefficient": 0.1})
    motion = prepared.motion(model, prepared.record)
    laws = damping_laws(model, 1, AT, motion, prepared.record)
    cut = split_decays(model, prepared.record)
    assert cut is not None
    return DampingFits(prepared, pendulum(), laws, cut)


def test_the_true_laws_leave_the_noise(trials):
    true = frozenset({COULOMB, DRAG, OWN})
    assert np.exp(trials.error(true)) == pytest.approx(1e-3, rel=0.1)
    numbers = trials.fits[true].model.parameters
    assert numbers["effect[1].force"] == pytest.approx(0.15, rel=0.05)
    assert numbers["effect[2].coefficient"] == pytest.approx(0.01, rel=0.1)


def test_they_predict_the_end_and_others_do_not(trials):
    true, other = frozenset({COULOMB, DRAG, OWN}), frozenset({COULOMB, SHAPE, OWN})
    trials.error(true), trials.error(other)
    assert np.exp(trials.extrapolation_error(true)) < 1.5e-3
    assert np.exp(trials.extrapolation_error(other)) > 1.5 * np.exp(
        trials.extrapolation_error(true)
    )


def test_what_a_set_cannot_fit_its_parts_are_not_asked(trials):
    plausible_sets = trials.plausible_sets()
    assert frozenset({COULOMB, DRAG, OWN}) in plausible_sets
    assert all(COULOMB in laws for laws in plausible_sets)
    assert frozenset({SHAPE}) not in trials.errors
    assert frozenset({OWN}) not in trials.errors


def test_what_was_found_is_asked_though_a_larger_set_fits_badly(trials, monkeypatch):
    """The fit of a larger set may end in a bad minimum, which is nothing against its parts."""
    fitted = DampingFits.error
    found = trials.found.found

    def badly(self, laws):
        return 10.0 if laws > found else fitted(self, laws)

    monkeypatch.setattr(DampingFits, "error", badly)
    again = DampingFits(trials.prepared, trials.reference, trials.found, trials.cut)
    again.plausible_sets()
    assert found in again.errors


def test_a_damper_that_is_left_out_stays_at_nothing(trials):
    without = frozenset({COULOMB, SHAPE, DRAG})
    trials.error(without)
    assert trials.fits[without].model.parameters["damper[0].damping"] == 0.0


def test_what_is_one_to_the_data_follows_from_how_much_is_predicted(trials):
    late = sum(part.samples for part in trials.cut.late)
    assert trials.same == pytest.approx(min(40 / late, 0.03))
