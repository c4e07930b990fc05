"""What follows from the thresholds of the structured searches."""

from robustpolish.synthesis.structured.search import POLICY, SearchEffort, StructuredPolicy


def test_agreement_needs_no_more_descents_than_are_asked_for():
    assert SearchEffort().agreeing == 4
    assert SearchEffort(fewest=3).agreeing == 3
    # A search by H2 Riccati designs can end after its fewest descents, if all agree.
    assert POLICY.observer_h2.agreeing == POLICY.observer_h2.fewest


def test_riccati_designs_leave_room_below_the_first_ceiling():
    policy = StructuredPolicy(ceilings=(1e3, 1e2), modest=0.25)
    assert policy.modest_entry == 250.0
    assert POLICY.modest_entry < POLICY.near_ceiling * POLICY.ceilings[0]
