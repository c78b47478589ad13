"""Says at the end how many inputs of each format were tried, and from which seed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from functools import lru_cache

import pytest

from supermap_cli.recordings import decoding
from support.fuzzing import TRIED


@pytest.fixture(autouse=True)
def _counted(request: pytest.FixtureRequest) -> Iterator[None]:
    before = Counter(TRIED)
    yield
    request.node.user_properties.append(("fuzzed", dict(TRIED - before)))


@pytest.fixture(autouse=True)
def _definitions_compiled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiling the definitions of a small recording takes longer than all that is tried with it."""
    monkeypatch.setattr(decoding, "_decoding_function", _DECODING)


_DECODING = lru_cache(500)(decoding._decoding_function)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    counts: Counter[str] = Counter()
    for reports in terminalreporter.stats.values():
        for report in reports:
            if getattr(report, "when", None) == "teardown":
                for name, tried in report.user_properties:
                    counts.update(tried if name == "fuzzed" else {})
    if not counts:
        return
    seed = terminalreporter.config.getoption("--hypothesis-seed", default=None)
    listed = ", ".join(f"{form} {count}" for form, count in sorted(counts.items()))
    terminalreporter.write_line(f"fuzzed {counts.total()} inputs, seed {seed or 'none: the same each time'}: {listed}")
