"""Run the hidden cases and print the confusion table: ``python -m tests.hidden_effects.run``."""

import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from robustpolish.identification import compare, diagnose

from .cases import model_of, records
from .catalogue import all_cases
from .drawn import drawn_cases

PAGE = Path(__file__).parents[2] / "docs" / "hidden_effects.md"


def normal(kind, at):
    """A place without ground and order."""
    return kind, frozenset(at) - {"ground"}


def judge(case, diagnosis):
    """Whether verdict, kinds and places are right, pairs reported as alike counted as right."""
    if diagnosis.verdict != case.verdict:
        return False
    if case.verdict != "missing_effect":
        return not diagnosis.effects or case.verdict == "unexplained"
    want = Counter(normal(kind, at) for kind, at, _ in case.effects)
    got = Counter(normal(e.kind, e.at) for e in diagnosis.effects)
    missing, extra = want - got, got - want
    for pair in diagnosis.indistinguishable:
        first, second = (
            normal(pair.first.kind, pair.first.at),
            normal(pair.second.kind, pair.second.at),
        )
        for a, b in ((first, second), (second, first)):
            if missing[a] and extra[b]:
                missing -= Counter([a])
                extra -= Counter([b])
    return not missing and not extra


def run_case(case):
    """Return one row: case, outcome, errors and processor time."""
    (data, _), (unseen, noise) = records(case)
    row = {
        "case": case.name,
        "truth": _named(case.effects) or "nothing",
        "verdict": "error",
        "found": "-",
        "alike": "",
        "right": False,
        "ratio": float("nan"),
    }
    began = time.process_time()
    try:
        diagnosis = diagnose(model_of(case), data)
        row["verdict"] = diagnosis.verdict
        row["found"] = _named((e.kind, e.at, None) for e in diagnosis.effects) or "-"
        row["alike"] = "; ".join(f"{p.first} / {p.second}" for p in diagnosis.indistinguishable)
        row["right"] = judge(case, diagnosis)
        errors = compare(diagnosis.model, unseen).outputs
        row["ratio"] = float(np.max([errors[name].rmse / noise[name] for name in noise]))
    except Exception as error:  # a failure is a result of the case
        row["found"] = f"{type(error).__name__}: {error}"
    row["seconds"] = time.process_time() - began
    return row


def _named(effects):
    return " + ".join(f"{kind} at {', '.join(at)}" for kind, at, _ in effects)


def table(rows):
    """The page: a summary and a table."""
    effects = [r for r, c in rows if c.verdict == "missing_effect"]
    calm = [r for r, c in rows if c.verdict == "missing_effect" and not c.chaotic]
    low = [r for r in calm if r["ratio"] <= 1.3]
    quiet = [r for r, c in rows if c.verdict in ("adequate", "parameters")]
    outside = [r for r, c in rows if c.verdict == "unexplained"]
    lines = [
        "# Hidden effects",
        "",
        "Seeded cases from an integrator of their own (tests/hidden_effects). The model sees one "
        "noisy record and is then compared with a second, unseen one. Made by "
        "`make hidden-effects`.",
        "",
        f"- kind and place right: {sum(r['right'] for r in effects)} of {len(effects)} cases with "
        "effects (pairs count if they are reported as alike)",
        f"- error on the unseen record at most 1.3 times the noise: {len(low)} of {len(calm)} "
        "that are not chaotic",
        f"- nothing missing, nothing named: {sum(r['right'] for r in quiet)} of {len(quiet)}",
        f"- outsiders left unexplained: {sum(r['right'] for r in outside)} of {len(outside)}",
        "",
        "## Confusion table",
        "",
        "How many times each truth was diagnosed as what; the cases with two effects are in the "
        "list below.",
        "",
        "| truth | diagnosed as | cases | counted right |",
        "|---|---|---|---|",
        *_confusion(rows),
        "",
        "## Cases",
        "",
        "| case | truth | verdict | found | alike | right | error / noise | CPU s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for r, _ in rows:
        lines.append(
            f"| {r['case']} | {r['truth']} | {r['verdict']} | {r['found']} | {r['alike']} | "
            f"{'yes' if r['right'] else '**no**'} | {r['ratio']:.2f} | {r['seconds']:.0f} |"
        )
    return "\n".join(lines) + "\n"


def _confusion(rows):
    """Lines of the confusion table, by kind."""
    counts, right = Counter(), Counter()
    for row, case in rows:
        if len(case.effects) > 1:
            continue
        truth = case.effects[0][0] if case.effects else f"nothing ({case.verdict})"
        named = row["found"] != "-" and row["verdict"] == "missing_effect"
        found = row["found"].split(" at ")[0] if named else row["verdict"]
        if named and " + " in row["found"]:
            found = "several effects"
        counts[truth, found] += 1
        right[truth, found] += row["right"]
    return [f"| {a} | {b} | {n} | {right[a, b]} |" for (a, b), n in counts.items()]


def main(arguments):
    """Run the cases and print the tables.

    Arguments are parts of names of cases, or ``--drawn SEED`` for cases drawn at random. The page
    of the documentation is written only if all cases of the catalogue ran.
    """
    drawn, names = arguments[:1] == ["--drawn"], arguments
    cases = drawn_cases(int(arguments[1])) if drawn else all_cases()
    if drawn:
        names = arguments[2:]
    cases = [c for c in cases if not names or any(name in c.name for name in names)]
    rows = []
    with ProcessPoolExecutor(2) as pool:
        for row, case in zip(pool.map(run_case, cases), cases, strict=True):
            rows.append((row, case))
            print(
                f"{'ok ' if row['right'] else 'BAD'} {row['case']:40s} {row['verdict']:14s} "
                f"{row['found']:50s} {row['ratio']:6.2f} {row['seconds']:6.1f} s",
                flush=True,
            )
    page = table(rows)
    print(page)
    if not arguments:
        PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
