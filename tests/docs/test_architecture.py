"""The page on the architecture names every wing."""

import re
from pathlib import Path

PROJECT = Path(__file__).parents[2]


def test_every_wing_is_named():
    page = (PROJECT / "docs" / "architecture.md").read_text(encoding="utf-8")
    wings = [f.name for f in (PROJECT / "robustpolish").iterdir() if (f / "__init__.py").exists()]
    assert len(wings) > 10
    assert [name for name in wings if not re.search(rf"\b{name}\b", page)] == []
