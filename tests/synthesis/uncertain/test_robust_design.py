from uncertain_plants import lag

import robustpolish as rp
from robustpolish.synthesis.uncertain.robust_output_feedback import RobustDesign


def test_a_design_shows_what_is_proven():
    design = rp.robust_output_feedback(lag(), "y", "u", gamma=1.5, order=1, effort=0.05)
    shown = repr(design)
    assert shown.startswith("Robust design: robust")
    assert "mu at most" in shown
    assert design.reason in shown
    assert design.margin == design.performance.lower
    assert design.mu == design.performance.mu


def test_without_a_controller_the_reason_is_all():
    design = RobustDesign(lag(), None, None, 1.0, "no controller", "Nothing stabilises it.")
    assert repr(design) == "Robust design: no controller\n  Nothing stabilises it."
    assert design.order is None
    assert design.margin == 0
    assert design.mu == (float("inf"), float("inf"))
