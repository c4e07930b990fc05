"""How the result shows itself."""

from polytope_examples import held_mass

import robustpolish as rp


def test_it_lists_its_vertices():
    design = rp.robust_state_feedback([held_mass(1.0), held_mass(9.0)], "h2")
    text = repr(design)
    assert text.startswith("Robust state feedback: proven")
    assert all(f"{norm:.4g}" in text for norm in design.vertex_norms)
    assert "unless they change with time" in text
