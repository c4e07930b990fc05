"""Sparse regression by pysindy on the residual force of one mass; run by `benchmarks/diagnosis.py`.

It runs in an interpreter of its own, for pysindy asks for versions that the package need not have:
``python pysindy_residual.py RECORD.npz`` prints one JSON object. Given are the time, the measured
displacement x and force F, and the known mass, damper and spring. The law sought is
F - m a - c v - k x as a polynomial in x and v.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import pysindy


def main() -> None:
    """Fit and print the terms and the time of the processor."""
    record = np.load(sys.argv[1])
    t, x, F = record["time"], record["x"], record["F"]
    start = time.process_time()
    slope = pysindy.SmoothedFiniteDifference()
    v = slope(x, t=t)
    a = slope(v, t=t)
    residual = F - record["m"] * a - record["c"] * v - record["k"] * x
    # The unit of each signal is its spread, so that the threshold means the same for all terms.
    units = np.std(x), np.std(v), np.std(F)
    library = pysindy.PolynomialLibrary(degree=3)
    optimizer = pysindy.STLSQ(threshold=0.02, alpha=1e-6)
    points = np.column_stack([x / units[0], v / units[1]])
    features = np.asarray(library.fit_transform(points))
    found = optimizer.fit(features, residual[:, None] / units[2]).coef_[0]
    names = library.get_feature_names(["x", "v"])
    spent = 1e3 * (time.process_time() - start)
    terms = {name: float(c) for name, c in zip(names, found, strict=True) if c}
    cubic = terms.get("x^3", 0.0) * units[2] / units[0] ** 3
    said = {"ms": spent, "terms": terms, "cubic": float(cubic), "version": pysindy.__version__}
    print(json.dumps(said))


if __name__ == "__main__":
    main()
