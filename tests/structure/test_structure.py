"""The package has no import cycle; what measures its layout measures right."""

from .imports import complaints


def test_the_package_has_no_cycle_and_no_crowded_folder():
    assert complaints("robustpolish") == []
