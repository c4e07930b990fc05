"""Marks of slow tests, from times that were measured: ``make times`` writes ``tests/slow.txt``.

A test costs its own processor time, and its part of what fixtures shared by several tests cost.
"""

import os
from collections import defaultdict
from pathlib import Path

import pytest

FILE = Path(__file__).with_name("slow.txt")
SLOW, LONG = 1.0, 5.0
"""Seconds of the processor from which a test is slow, and from which it is long."""
_HEAD = "# Tests that take more than a second of the processor; `make times` measures them.\n"


def known():
    """Return the seconds of slow tests by their node ids."""
    lines = FILE.read_text("utf-8").splitlines() if FILE.exists() else []
    pairs = [line.split(maxsplit=1) for line in lines if not line.startswith("#")]
    return {node: float(seconds) for seconds, node in pairs}


class Marks:
    """Marks tests as slow or long."""

    @pytest.hookimpl(tryfirst=True)  # before `-m` selects
    def pytest_collection_modifyitems(self, items):
        seconds = known()
        for item in items:
            spent = seconds.get(item.nodeid, 0.0)
            if spent > SLOW:
                item.add_marker("long" if spent > LONG else "slow")


class Measure:
    """Measures every test that runs, and writes the file at the end."""

    def __init__(self):
        self.own = defaultdict(float)
        self.users, self.shared = defaultdict(set), defaultdict(float)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef, request):
        before = computing_time()
        try:
            return (yield)
        finally:
            if fixturedef.scope != "function":
                key = f"{fixturedef.baseid}:{fixturedef.argname}:{request.param_index}"
                request.node.config.stash.setdefault(_MADE, []).append(
                    (key, computing_time() - before)
                )

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item):
        item.config.stash[_MADE] = []
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item):
        before = computing_time()
        try:
            return (yield)
        finally:
            uses = [
                f"{d[-1].baseid}:{name}" for name, d in item._fixtureinfo.name2fixturedefs.items()
            ]
            made = item.config.stash[_MADE]
            item.user_properties.append(("times", (computing_time() - before, made, uses)))

    def pytest_runtest_logreport(self, report):
        if report.when != "call":
            return
        for own, made, uses in (value for name, value in report.user_properties if name == "times"):
            self.own[report.nodeid] += own
            for key, seconds in made:
                self.shared[key] += seconds
            for key in uses:
                self.users[key].add(report.nodeid)

    def pytest_sessionfinish(self, session):
        if hasattr(session.config, "workerinput"):
            return
        seconds = known() | dict(self.own)
        for key, spent in self.shared.items():
            users = self.users[key.rpartition(":")[0]]
            for node in users:
                seconds[node] += spent / len(users)
        slow = sorted((node, spent) for node, spent in seconds.items() if spent > SLOW)
        FILE.write_text(_HEAD + "".join(f"{spent:.1f} {node}\n" for node, spent in slow), "utf-8")


_MADE = pytest.StashKey()


def computing_time():
    """Return the seconds that this process and its children have computed."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
