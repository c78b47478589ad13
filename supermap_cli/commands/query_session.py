"""`supermap query -i`: many questions in one process, with history and completion of labels and ids.

With prompt_toolkit where it is installed (extra `[interactive]`), else with readline; from a pipe, a question a line.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from platformdirs import user_state_path

from supermap_cli.commands.streams import tell
from supermap_cli.errors import SupermapError
from supermap_cli.memory.reading import MapReader

PROMPT = "supermap> "
MAX_COMPLETIONS = 50
"""Words offered for one beginning."""
HISTORY_LINES = 1000
"""Questions that readline keeps."""


def ask_until_the_end(reader: MapReader, ask: Callable[[str], None]) -> None:
    """Ask each line until Ctrl-D, "exit" or "quit"; a refused question is told, and the next one asked."""
    for line in _lines(reader):
        text = line.strip()
        if text in {"exit", "quit"}:
            return
        if text:
            try:
                ask(text)
            except SupermapError as error:
                tell(error)
        sys.stdout.flush()


def completions(reader: MapReader, word: str) -> list[str]:
    """The labels, ids and traversals that begin with a word."""
    labels = sorted(label for label in reader.search.current_labels() if label.startswith(word.casefold()))
    names = [traversal.name for traversal in reader.traversals if traversal.name.startswith(word)]
    ids = reader.search.ids_from(word, MAX_COMPLETIONS) if "-" in word else []
    return [*labels, *names, *ids][:MAX_COMPLETIONS]


def _lines(reader: MapReader) -> Iterator[str]:
    if not sys.stdin.isatty():
        return iter(sys.stdin)
    try:
        return _prompt_toolkit_lines(reader)
    except ImportError:
        return _readline_lines(reader)


def _history_file() -> Path | None:
    """Where questions are kept; `None` where that folder cannot be made."""
    with suppress(OSError):
        folder = user_state_path("supermap")
        folder.mkdir(parents=True, exist_ok=True)
        return folder / "query_history"
    return None


def _prompt_toolkit_lines(reader: MapReader) -> Iterator[str]:
    """Raises `ImportError` where prompt_toolkit is not installed."""
    from prompt_toolkit import PromptSession  # noqa: PLC0415 - an extra
    from prompt_toolkit.completion import Completer, Completion  # noqa: PLC0415
    from prompt_toolkit.completion.base import CompleteEvent  # noqa: PLC0415
    from prompt_toolkit.document import Document  # noqa: PLC0415
    from prompt_toolkit.history import FileHistory, InMemoryHistory  # noqa: PLC0415

    class MapCompleter(Completer):
        """Completes the word before the cursor."""

        def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterator[Completion]:  # noqa: ARG002
            word = document.get_word_before_cursor(WORD=True)
            return (Completion(found, -len(word)) for found in completions(reader, word) if word)

    path = _history_file()
    history = InMemoryHistory() if path is None else FileHistory(str(path))
    session: PromptSession[str] = PromptSession(history=history, completer=MapCompleter(), complete_while_typing=False)
    return _prompted(lambda: session.prompt(PROMPT))


def _readline_lines(reader: MapReader) -> Iterator[str]:
    with suppress(ImportError):
        import readline  # noqa: PLC0415 - missing on some builds of Python

        def complete(word: str, at: int) -> str | None:
            found = completions(reader, word)
            return found[at] if at < len(found) else None

        readline.set_completer(complete)
        readline.set_completer_delims(" \t\n")
        readline.parse_and_bind("tab: complete")
        readline.set_history_length(HISTORY_LINES)
        path = _history_file()
        if path is not None:
            with suppress(OSError):
                readline.read_history_file(path)
            return _saved(_prompted(lambda: input(PROMPT)), lambda: readline.write_history_file(path))
    return _prompted(lambda: input(PROMPT))


def _prompted(prompt: Callable[[], str]) -> Iterator[str]:
    """Lines until Ctrl-D; Ctrl-C leaves one line."""
    while True:
        try:
            yield prompt()
        except KeyboardInterrupt:
            continue
        except EOFError:
            return


def _saved(lines: Iterator[str], save: Callable[[], None]) -> Iterator[str]:
    try:
        yield from lines
    finally:
        with suppress(OSError):
            save()
