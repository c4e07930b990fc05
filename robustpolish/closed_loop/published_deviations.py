"""The largest deviations that the thesis prints in chapter 11.

The numbers are those of M.L. Postma, Polishing robot: vibrations due to impact, tables 11.1, 11.3,
11.5 and 11.7. What they are worth is told by :func:`robustpolish.closed_loop.thesis_comparison`.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

Deviations = Mapping[str, tuple[float, float, float]]

PUBLISHED_DEVIATIONS: Mapping[int, Deviations] = MappingProxyType(
    {
        1: MappingProxyType(
            {
                "without control": (7.8095e-4, 0.0177, 1.9855e-4),
                "first": (0.0, 7.5486e-4, 7.1232e-6),
                "first_scaled": (0.0, 4.5467e-4, 8.0705e-6),
                "second": (0.0, 7.4643e-5, 2.4510e-5),
                "second_scaled": (0.0, 6.8915e-4, 9.7659e-6),
            }
        ),
        4: MappingProxyType(
            {
                "without control": (0.0011, 0.0094, 1.5049e-4),
                "first": (0.0, 7.9841e-4, 1.2877e-5),
                "first_scaled": (0.0, 4.9490e-4, 1.2861e-5),
                "second": (0.0, 8.2640e-5, 4.6829e-5),
                "second_scaled": (0.0, 8.0809e-4, 1.9925e-5),
            }
        ),
    }
)
"""Largest deviation [m] in x, y and z by run and row, as printed."""
