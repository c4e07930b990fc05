"""The page of the documentation: what came out of all cases."""

from collections import Counter

import numpy as np

from .drawn import CLASSES, JUDGED_SEED, class_of
from .figures import (
    LAW_ERROR,
    LAW_SHARE,
    NEAR_FLOOR,
    NEAR_NOISE,
    by_number,
    curves_held,
    figures,
    law_learned,
    share,
)
from .judge import NAMED
from .laws import KINDS, UNSEEN_LAWS
from .several import NUMBERS_OF_EFFECTS, UNSEEN_SEED, number_of_effects


def page(rows, drawn, several, laws):
    """The page: the cases of the catalogue, those drawn at random, with several, and laws.

    Of the last two only those that no rule has seen tell how good the diagnosis is.
    """
    parts = [_catalogue(rows), _drawn(drawn), _several(several), _laws(laws)]
    return "\n\n".join("\n".join(lines) for lines in parts) + "\n"


def _catalogue(rows):
    """Lines on the cases of the catalogue: a summary and two tables."""
    effects = [r for r, c in rows if c.verdict == "missing_effect"]
    calm = [r for r, c in rows if c.verdict == "missing_effect" and not c.chaotic]
    low = share(r["ratio"] <= NEAR_NOISE for r in calm)
    quiet = share(r["right"] for r, c in rows if c.verdict in ("adequate", "parameters"))
    laws = [r for r, c in rows if c.verdict == "unknown_law"]
    outside = share(r["right"] for r, c in rows if c.verdict == "unexplained")
    return [
        "# Hidden effects",
        "",
        "Seeded cases from an integrator of their own (tests/hidden_effects). The model sees one "
        "noisy record and is then compared with a second, unseen one. Made by "
        "`make hidden-effects`.",
        "",
        f"- kind and place right: {share(r['right'] for r in effects)} cases with effects (pairs "
        "count if they are reported as alike)",
        f"- error on the unseen record at most {NEAR_NOISE} times the noise: {low} that are not "
        "chaotic",
        f"- nothing missing, nothing named: {quiet}",
        f"- laws that no catalogue holds, learned at their place: {share(r['right'] for r in laws)}"
        f"; with an error of at most {LAW_ERROR} times the noise on the unseen record and the true "
        f"curve within the 95 % band over {100 * LAW_SHARE:.0f} % of the range that was seen: "
        f"{share(law_learned(r) for r in laws)}",
        f"- no static law at all, and no name given: {outside}",
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
        *cases_table(rows),
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
    return [*lines, "", "Those that fail:", "", *cases_table(wrong)] if wrong else lines


def _several(rows):
    """Lines on the cases with up to three effects."""
    return [
        "## Cases with up to three effects",
        "",
        "Drawn by one plan (tests/hidden_effects/several.py): one to three masses or two "
        "axes, sensors of displacement, velocity and acceleration mixed, white and "
        "coloured noise 20 to 60 dB below the signal, free decays and blows beside noise, "
        "multisines and sweeps, wrong numbers in two of five. Leaving any effect out changes a "
        "signal by more than the noise, even after a refit of springs, dampers and the start.",
        "",
        f"{len(rows)} cases of seed {UNSEEN_SEED}: no rule of the diagnosis was changed while "
        "looking at them, so that they tell how good it is.",
        "",
        *_group(rows),
    ]


def _laws(rows):
    """Lines on the laws drawn at random: by kind, and all of them."""
    lines = [
        "## Laws that no catalogue holds",
        "",
        "Drawn by one plan on the same machines (tests/hidden_effects/laws.py): springs of the "
        "fifth power, springs that saturate or drift, and springs with a dead zone beside "
        "friction. Each shows, and of the first two a cubic and a quadratic spring at their "
        "place leave visibly more than the noise.",
        "",
        f"{len(rows)} cases of seed {UNSEEN_LAWS}: no rule of the diagnosis was changed while "
        "looking at them.",
        "",
        f"| law | learned at its place | error at most {LAW_ERROR} times the noise on the unseen "
        f"record | true curve within the 95 % band over {100 * LAW_SHARE:.0f} % of the range "
        "| a wrong name |",
        "|---|---|---|---|---|",
    ]
    kinds = {kind: [r for r, c in rows if c.effects[0][0] == kind] for kind in KINDS}
    for name, of_kind in {**kinds, "all": [r for r, _ in rows]}.items():
        near = share(r["ratio"] <= LAW_ERROR for r in of_kind)
        held = share(curves_held(r) for r in of_kind)
        wrong = share(r["wrong"] for r in of_kind)
        right = share(r["right"] for r in of_kind)
        lines.append(f"| {name} | {right} | {near} | {held} | {wrong} |")
    return [*lines, "", *cases_table(rows)]


def _group(rows):
    """Lines on one group: what is asked of it, by number of effects, and failures."""
    found = figures(rows)
    wrong = [(row, case) for row, case in rows if not row["right"]]
    lines = [
        "| asked | found | at least |",
        "|---|---|---|",
        f"| kind and place right, or indistinguishable | {found.right} | 95 % |",
        f"| a wrong name, not indistinguishable | {found.confident} | at most 2 % |",
        f"| nothing named where nothing is missing | {found.quiet} | 98 % |",
        f"| 95 % intervals of effects' numbers that hold the truth | {found.covered} | 90 to 99 % "
        "|",
        f"| stated noise within a factor {NEAR_FLOOR} of the true one, by sensor | {found.floors} "
        "| 95 % |",
        "",
        "Intervals are counted in cases in which every name is right; those of all effects that "
        f"are named right: {found.covered_all}; of masses, springs and dampers in the same cases: "
        f"{found.own_covered}. All intervals of a case hold the truth in {found.cases_covered} "
        f"cases, all noises are near the true ones in {found.cases_floors}. The error on the "
        f"unseen record is at most {NEAR_NOISE} times the noise in {found.calm} of the right cases "
        "whose motion can be foreseen.",
        "",
        "| class | cases | right | effects | named right | alike | missed | wrong names |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in NUMBERS_OF_EFFECTS:
        of_class = [row for row, case in rows if number_of_effects(case) == name]
        exact, swapped, missed = (
            sum(row[key] for row in of_class) for key in ("exact", "swapped", "missed")
        )
        lines.append(
            f"| {name} | {len(of_class)} | {sum(row['right'] for row in of_class)} | "
            f"{exact + swapped + missed} | {exact} | {swapped} | {missed} | "
            f"{sum(len(row['wrong']) for row in of_class)} |"
        )
    lines += [
        "",
        "Intervals by number, and the median of the errors in standard errors (0.67 if these are "
        "right):",
        "",
        "| number | hold the truth | median error / standard error |",
        "|---|---|---|",
        *(
            f"| {name} | {held} | {sigmas:.2f} |"
            for name, (held, sigmas) in by_number(rows).items()
        ),
    ]
    return [*lines, "", "Those that are not right:", "", *cases_table(wrong)] if wrong else lines


def cases_table(rows):
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
        named = row["found"] != "-" and row["verdict"] in NAMED
        found = row["found"].split(" at ")[0] if named else row["verdict"]
        if named and " + " in row["found"]:
            found = "several effects"
        counts[truth, found] += 1
        right[truth, found] += row["right"]
    return [f"| {a} | {b} | {n} | {right[a, b]} |" for (a, b), n in counts.items()]
