"""Run the hidden cases and print the confusion table: ``python -m tests.hidden_effects.run``."""

import os
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from robustpolish.identification import compare, diagnose

from .cases import model_of, records
from .catalogue import all_cases
from .drawn import CLASSES, JUDGED_SEED, class_of, drawn_cases

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


def page(rows, drawn):
    """The page: the cases of the catalogue, then those drawn at random."""
    return "\n".join([*_catalogue(rows), "", *_drawn(drawn)]) + "\n"


def _catalogue(rows):
    """Lines on the cases of the catalogue: a summary and two tables."""
    effects = [r for r, c in rows if c.verdict == "missing_effect"]
    calm = [r for r, c in rows if c.verdict == "missing_effect" and not c.chaotic]
    low = [r for r in calm if r["ratio"] <= 1.3]
    quiet = [r for r, c in rows if c.verdict in ("adequate", "parameters")]
    outside = [r for r, c in rows if c.verdict == "unexplained"]
    return [
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
        "These cases were chosen by hand, and the rules of the diagnosis were changed while "
        "looking at them. Those [drawn at random](#cases-drawn-at-random) are the fairer ones.",
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
        *_cases(rows),
    ]


def _drawn(rows):
    """Lines on the cases drawn at random: their share right by class, and those that fail."""
    right = [row["right"] for row, _ in rows]
    wrong = [(row, case) for row, case in rows if not row["right"]]
    lines = [
        "## Cases drawn at random",
        "",
        f"{len(rows)} machines, effects and everyday data that nobody chose by hand: the whole "
        f"plan of seed {JUDGED_SEED} (tests/hidden_effects/drawn.py). {sum(right)} of {len(rows)} "
        f"are right, that is {100 * np.mean(right):.0f} %.",
        "",
        "| class | cases | right |",
        "|---|---|---|",
    ]
    for name in CLASSES:
        of_class = [row["right"] for row, case in rows if class_of(case) == name]
        lines.append(f"| {name} | {len(of_class)} | {sum(of_class)} |")
    return [*lines, "", "Those that fail:", "", *_cases(wrong)] if wrong else lines


def _cases(rows):
    """Lines of a table of cases."""
    return [
        "| case | truth | verdict | found | alike | right | error / noise | CPU s |",
        "|---|---|---|---|---|---|---|---|",
        *(
            f"| {r['case']} | {r['truth']} | {r['verdict']} | {r['found']} | {r['alike']} | "
            f"{'yes' if r['right'] else '**no**'} | {r['ratio']:.2f} | {r['seconds']:.0f} |"
            for r, _ in rows
        ),
    ]


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


def run_all(cases):
    """Return rows and cases, computed on as many cores as this process may use."""
    rows = []
    with ProcessPoolExecutor(_cores()) as pool:
        for row, case in zip(pool.map(run_case, cases), cases, strict=True):
            rows.append((row, case))
            print(
                f"{'ok ' if row['right'] else 'BAD'} {row['case']:40s} {row['verdict']:14s} "
                f"{row['found']:50s} {row['ratio']:6.2f} {row['seconds']:6.1f} s",
                flush=True,
            )
    return rows


def _cores():
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def main(arguments):
    """Run the cases and print what came out.

    Arguments are parts of names of cases, or ``--drawn SEED`` and parts of names for cases drawn
    at random. Without any, all cases of the catalogue and of the judged seed run, and the page of
    the documentation is written.
    """
    if arguments:
        drawn = arguments[0] == "--drawn"
        cases = drawn_cases(int(arguments[1])) if drawn else all_cases()
        names = arguments[2:] if drawn else arguments
        chosen = [c for c in cases if not names or any(name in c.name for name in names)]
        rows = run_all(chosen)
        print("\n".join(_cases(rows)))
    else:
        text = page(run_all(all_cases()), run_all(drawn_cases(JUDGED_SEED)))
        print(text)
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
