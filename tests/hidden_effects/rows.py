"""One row for each case: what the diagnosis said, and how it compares with the truth."""

import time

import numpy as np

from robustpolish.identification.compare import compare
from robustpolish.identification.diagnose import diagnose

from .cases import model_of, records
from .curves import curve_shares
from .intervals import effect_numbers, floor_ratios, own_numbers
from .judge import judge, marks


def run_case(case):
    """Return one row, plain data: outcome, numbers, errors and processor time."""
    (data, seen_noise), (unseen, noise) = records(case)
    row = empty_row(case)
    began = time.process_time()
    try:
        diagnosis = diagnose(model_of(case), data)
        row |= told(case, data, seen_noise, diagnosis)
        errors = compare(diagnosis.model, unseen).outputs
        row["ratio"] = float(np.max([errors[name].rmse / noise[name] for name in noise]))
    except Exception as error:  # a failure is a result of the case
        row = empty_row(case) | {"found": f"{type(error).__name__}: {error}"}
    row["seconds"] = time.process_time() - began
    return row


def empty_row(case):
    """Return the row of a case about which nothing was said."""
    return {
        "case": case.name,
        "truth": named((kind, at) for kind, at, _ in case.effects) or "nothing",
        "verdict": "error",
        "found": "-",
        "alike": "",
        "right": False,
        "ratio": float("nan"),
        "exact": 0,
        "swapped": 0,
        "missed": len(case.effects),
        "wrong": [],
        "named": 0,
        "numbers": [],
        "own": [],
        "floors": {},
        "curves": [],
        "seconds": 0.0,
    }


def told(case, data, noise, diagnosis):
    """Return what a diagnosis of a record adds to the row of its case.

    Numbers are rows of name, truth, value and standard error. Those of the model itself are told
    only where all effects are right, as they carry what is missing.
    """
    found = marks(case, diagnosis)
    right = judge(case, diagnosis)
    return {
        "verdict": diagnosis.verdict,
        "found": named((e.kind, e.at) for e in diagnosis.effects) or "-",
        "alike": "; ".join(f"{p.first} / {p.second}" for p in diagnosis.indistinguishable),
        "right": right,
        "exact": found.exact,
        "swapped": found.alike,
        "missed": found.missed,
        "wrong": list(found.wrong),
        "named": len(diagnosis.effects),
        "numbers": [list(stated) for stated in effect_numbers(case, diagnosis)],
        "own": [
            list(stated)
            for stated in (own_numbers(case, diagnosis) if right and not found.alike else [])
        ],
        "floors": floor_ratios(data, noise, diagnosis),
        "curves": curve_shares(case, diagnosis),
    }


def named(effects):
    """Return kinds and places in one line."""
    return " + ".join(f"{kind} at {', '.join(at)}" for kind, at in effects)
