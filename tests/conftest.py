"""Fixtures that all tests share."""

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder with measurements and benchmark plants beside the checkout."""
    if not SHARED.is_dir():
        pytest.skip("the folder ../shared with measurements and benchmarks is not here")
    return SHARED
