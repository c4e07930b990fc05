"""The check of what has to be a design."""

from __future__ import annotations

from typing import Any

from robustpolish.synthesis.design.design import Design
from robustpolish.validation import instance_of


def checked_design(argument: str, value: Any) -> Design:
    """Return `value` if it is a design; refuse a bare controller with the way to make it one.

    Examples
    --------
    >>> checked_design("design", -3.0)
    Traceback (most recent call last):
    ...
    robustpolish.errors.InvalidInputError: design: got float, expected a Design. Pass what a
    synthesis returned, or given_controller(plant, K) for a controller K of your own.
    """
    own = "given_controller(plant, K) for a controller K of your own"
    return instance_of(
        argument, value, Design, "a Design", f"Pass what a synthesis returned, or {own}."
    )
