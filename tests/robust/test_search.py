from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.search import bounds
from tests.robust.loops import servo


def test_both_bounds_meet():
    found = bounds(LoopModel.of(servo()))
    assert found.coverage.complete
    assert 1 <= found.coverage.level * found.witness.size <= 1.002
