"""Run the hidden cases and write their page: ``python -m tests.hidden_effects.run``.

Parts of names choose cases of the catalogue, with ``--drawn SEED`` those drawn at random from a
seed, with ``--several`` the hundred with up to three effects that rules were tuned on, with
``--unseen`` another hundred of the kind that no rule has seen, with ``--laws SEED`` laws that no
catalogue holds. Without any of these all cases but those that rules were tuned on run, and the
page of the documentation is written. ``--part 0/2``
takes every second case, of all or of those chosen, and writes no page. ``--keep FILE`` keeps a row
for each case that is done, and takes those that it holds for granted: an interrupted run goes on,
parts of two machines come together.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from robustpolish.base.sweep import cores

from .catalogue import all_cases
from .drawn import JUDGED_SEED, drawn_cases
from .kept import keep, kept_rows, key_of
from .laws import LAWS, UNSEEN_LAWS, law_case, name_of_law
from .page import cases_table, page
from .rows import run_case
from .several import PLAN, SEEN_SEED, UNSEEN_SEED, name_of, several_case

PAGE = Path(__file__).parents[2] / "docs" / "hidden_effects.md"


def run_all(cases, file=None):
    """Return rows and cases, computed on as many cores as this process may use.

    Rows that stand in the file are taken from there, the others are added to it.
    """
    # No sweep of the package: a row is nested text, whose lists are as long as a case has effects,
    # and not an array over cases; and the file of a sweep belongs to one list of points and one
    # function, where rows of other cases, of parts and of older sources stand side by side here.
    rows = kept_rows(file)
    left = [case for case in cases if key_of(case) not in rows]
    with ProcessPoolExecutor(cores()) as pool:
        running = {pool.submit(run_case, case): case for case in left}
        for done in as_completed(running):
            case, row = running[done], done.result()
            rows[key_of(case)] = row
            keep(file, case, row)
            print(
                f"{'ok ' if row['right'] else 'BAD'} {row['case']:40s} {row['verdict']:14s} "
                f"{row['found']:50s} {row['ratio']:6.2f} {row['seconds']:6.1f} s",
                flush=True,
            )
    return [(rows[key_of(case)], case) for case in cases]


def drawn_several(seed, names=(), part=(0, 1)):
    """Return cases of a seed with several effects."""
    return _drawn(several_case, [name_of(i) for i in range(len(PLAN))], seed, names, part)


def drawn_laws(seed, names=(), part=(0, 1)):
    """Return laws of a seed."""
    return _drawn(law_case, [name_of_law(i) for i in range(len(LAWS))], seed, names, part)


def _drawn(draw, plan, seed, names, part):
    """Return the cases of a plan on all cores: it takes minutes to see that effects show."""
    numbers = [i for i, name in enumerate(plan) if _chosen(name, names)][part[0] :: part[1]]
    with ProcessPoolExecutor(cores()) as pool:
        return list(pool.map(draw, numbers, [seed] * len(numbers)))


def _chosen(name, names):
    return not names or any(part in name for part in names)


def _part(text):
    """Read which part of how many: 0/2 is the first of two."""
    number, _, of = text.partition("/")
    if not (number.isdigit() and of.isdigit() and int(number) < int(of)):
        raise argparse.ArgumentTypeError(f"{text!r} is no part such as 0/2 or 1/2")
    return int(number), int(of)


def main(arguments=None):
    """Run cases and print what came out."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.hidden_effects.run",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("names", nargs="*", help="parts of names of cases")
    parser.add_argument("--drawn", type=int, metavar="SEED", help="those drawn from a seed")
    parser.add_argument("--several", action="store_true", help="those with several effects")
    parser.add_argument("--unseen", action="store_true", help="such as no rule was tuned on")
    parser.add_argument("--laws", type=int, metavar="SEED", help="laws drawn from a seed")
    parser.add_argument("--part", type=_part, metavar="I/N", help="every N-th case from I on")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="where rows are kept")
    given = parser.parse_args(arguments)
    first, step = given.part or (0, 1)

    def some(cases):
        return [case for case in cases if _chosen(case.name, given.names)][first::step]

    if given.several or given.unseen:
        seeds = [SEEN_SEED] * given.several + [UNSEEN_SEED] * given.unseen
        chosen = [drawn_several(seed, given.names, (first, step)) for seed in seeds]
    elif given.drawn is not None:
        chosen = [some(drawn_cases(given.drawn))]
    elif given.laws is not None:
        chosen = [drawn_laws(given.laws, given.names, (first, step))]
    elif given.names:
        chosen = [some(all_cases())]
    else:
        several = drawn_several(UNSEEN_SEED, part=(first, step))
        laws = drawn_laws(UNSEEN_LAWS, part=(first, step))
        chosen = [some(all_cases()), some(drawn_cases(JUDGED_SEED)), several, laws]
    rows = [run_all(cases, given.keep) for cases in chosen]
    if len(rows) == 4 and given.part is None:
        text = page(*rows)
        print(text)
        PAGE.write_text(text, encoding="utf-8")
    else:
        print("\n".join(cases_table([item for group in rows for item in group])))


if __name__ == "__main__":
    main()
