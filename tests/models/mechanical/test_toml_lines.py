"""Where in a TOML text a key stands."""

import pytest

from robustpolish.machines.mechanical.toml import line_of

LINES = """\
[dof."my x"]
mass = 1
[[spring]]
stiffness = 1
[[spring]] # the other
between = "a, b"
"stiffness" = 2
[[input]]
name = "F"
[[input]]
name = 'F'  # again
gain = 3
"""


@pytest.mark.parametrize(
    ("key", "line"),
    [
        (("dof", "my x"), 1),
        (("dof", "my x", "mass"), 2),
        (("spring", 0, "stiffness"), 4),
        (("spring", 1, "stiffness"), 7),
        (("spring", 1, "damping"), 5),
        (("input", "F"), 10),
        (("input", "F", "gain"), 12),
        (("input", 0, "gain"), 8),
        (("spring",), 3),
        (("output", "y"), None),
        (("spring", 7), 3),
        ((), None),
    ],
)
def test_line_of_a_key(key, line):
    assert line_of(LINES, key) == line


def test_line_of_a_key_that_is_nowhere():
    assert line_of("", ("spring", 3, "stiffness")) is None
    assert line_of("[dof.x]\n", ("something",)) is None
