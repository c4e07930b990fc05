"""Tuned blocks: by name, as a table, in files."""

import json
import math

import pytest

from robustpolish.synthesis.structured.block_parts import TunedBlock, TunedBlocks, TunedNumber


def tuned():
    numbers = (
        TunedNumber("Kp", 2.0, "N/m", "k", 0.0, 2.0, True),
        TunedNumber("Ki", 3.0, "N/(m s)", "pid_x.Ki", -math.inf, math.inf, True),
        TunedNumber("Tf", 0.1, "s", "pid_x.Tf", 0.1, 0.1, False),
    )
    return TunedBlocks((TunedBlock("pid_x", "(Kp + Ki/s)", numbers),), ("F = -(Kp + Ki/s) x",))


def test_by_name():
    blocks = tuned()
    assert list(blocks) == ["pid_x"]
    assert len(blocks) == 1
    assert blocks["pid_x"]["Ki"] == 3.0
    assert blocks.numbers == {"k": 2.0, "pid_x.Ki": 3.0}
    for missing in (lambda: blocks["pid"], lambda: blocks["pid_x"]["Kd"]):
        with pytest.raises(KeyError):
            missing()


def test_shows_units_limits_and_shared_names():
    lines = [" ".join(line.split()) for line in repr(tuned()).splitlines()]
    assert lines[2:] == [
        "pid_x Kp = k 2 N/m at its limit",
        "pid_x Ki 3 N/(m s) tuned",
        "pid_x Tf 0.1 s held",
        "F = -(Kp + Ki/s) x",
    ]
    assert "at its limit" in tuned()._repr_html_()


def test_comes_back_from_a_file():
    content = json.loads(json.dumps(tuned().content(), allow_nan=False))
    again = TunedBlocks.of_content(content)
    assert (again.blocks, again.laws) == (tuned().blocks, tuned().laws)


def test_a_free_state_space_lists_no_entries():
    entries = tuple(TunedNumber(f"A[{i}]", 1.0, "", f"K.A[{i}]", -1, 1, True) for i in range(20))
    blocks = TunedBlocks((TunedBlock("K", "state space", entries),), ("u = K y",))
    assert repr(blocks) == "u = K y"
    assert blocks["K"]["A[3]"] == 1.0
