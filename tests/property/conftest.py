"""What is promised for any input, searched by Hypothesis: briefly here, for long by `make fuzz`.

    pytest tests/property --minutes 10 -k laws

searches each promise that is named for its share of the time, in rounds with seeds that are
printed. Hypothesis shrinks what fails and keeps it in runs/fuzz, from where it is tried first the
next time; `--hypothesis-seed` repeats a round, also one that ended the process.
"""

import functools
import secrets
import time
from collections import Counter
from datetime import timedelta
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from hypothesis import HealthCheck, settings
from hypothesis.database import DirectoryBasedExampleDatabase

MOST_SECONDS = 60.0
"""Of one case."""

settings.register_profile("suite", max_examples=15, deadline=None, derandomize=True, database=None,
                          suppress_health_check=list(HealthCheck))  # fmt: skip
settings.register_profile(
    "search",
    max_examples=1000,
    deadline=timedelta(seconds=MOST_SECONDS),
    database=DirectoryBasedExampleDatabase(Path("runs/fuzz")),
    suppress_health_check=list(HealthCheck),
)

_cases = pytest.StashKey[Counter[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--minutes", type=float, help="search for so long, all promises together")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_cases] = Counter()
    settings.load_profile("suite" if config.getoption("--minutes", None) is None else "search")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    for item in items if config.getoption("--minutes", None) is None else ():
        if item.get_closest_marker("long_search"):
            item.add_marker(pytest.mark.skip(reason="takes minutes: make fuzz"))


def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Repeat a property until its share of the time is over, with another seed each time."""
    config, test = pyfuncitem.config, pyfuncitem.obj
    minutes = config.getoption("--minutes", None)
    if minutes is None or not hypothesis.is_hypothesis_test(test):
        return None
    given = {name: pyfuncitem.funcargs[name] for name in pyfuncitem._fixtureinfo.argnames}
    files = [item.path for item in pyfuncitem.session.items]
    share = 1.0 / (len(set(files)) * files.count(pyfuncitem.path))
    name, end = pyfuncitem.name, time.monotonic() + 60.0 * minutes * share
    inner, count, failed = test.hypothesis.inner_test, 0, False

    @functools.wraps(inner)
    def tried(*args: Any, **kwargs: Any) -> None:  # and nothing once the time is over
        nonlocal count, failed
        if not failed:  # what fails is shrunk, for as long as that takes
            if count and time.monotonic() > end:
                return
            count += 1
            config.stash[_cases][pyfuncitem.path.stem] += 1
        try:
            inner(*args, **kwargs)
        except Exception:
            failed = True
            raise

    print(f"\n{name} --hypothesis-seed", end="", flush=True)
    test.hypothesis.inner_test = tried
    try:
        while not count or time.monotonic() < end:
            seed = config.getoption("--hypothesis-seed") or secrets.randbelow(2**32)
            print(f" {seed}", end="", flush=True)
            hypothesis.seed(int(seed))(test)(**given)
    finally:
        test.hypothesis.inner_test = inner  # that is of all parameters of a test
    return True


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    if tried := config.stash[_cases]:
        terminalreporter.write_line("\n| Promises | Cases |\n| --- | --- |")
        for name, cases in tried.items():
            terminalreporter.write_line(f"| {name.removeprefix('test_')} | {cases:,} |")
