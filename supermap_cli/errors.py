"""One tree of errors. What the user can mend is a `SupermapError`; everything else is a bug and shows its traceback."""

from __future__ import annotations

from collections.abc import Iterable


class SupermapError(Exception):
    """Something the user can mend: what was wrong, where, and the cure, in one line.

    `main` is the only place that catches it: ``error: <what> (<where>): <cure>`` on stderr, exit code 1 (130, as shells
    have it, where the user stopped it).
    """

    exit_code = 1
    warnings: tuple[str, ...] = ()

    def __init__(self, what: str, *, where: str | None = None, cure: str | None = None) -> None:
        self.what = what
        self.where = where
        self.cure = cure
        super().__init__(str(self))

    def add_warnings(self, lines: Iterable[str]) -> None:
        """What had been warned of before: it is told with the error, of which it may be the cause."""
        self.warnings = tuple(dict.fromkeys((*lines, *self.warnings)))

    def __str__(self) -> str:
        """The whole message on one line."""
        place = f" ({self.where})" if self.where else ""
        cure = f": {self.cure}" if self.cure else ""
        return " ".join(f"{self.what}{place}{cure}".split())


STUMBLES = (ArithmeticError, AssertionError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
"""What code raises that is given values which cannot be: where they came from outside, they are at fault."""


class UsageError(SupermapError):
    """A command line is not understood."""

    exit_code = 2


class BuildStoppedError(SupermapError):
    """A build was asked to stop: what is mapped so far is kept."""

    exit_code = 130


class RecordingError(SupermapError):
    """A recording cannot be read, or lacks what a build needs."""


class CalibrationError(RecordingError):
    """A camera model or a transform between frames is missing or makes no sense."""


class OdometryError(SupermapError):
    """There is no usable motion estimate."""


class UnusablePosesError(OdometryError, RecordingError):
    """The poses that a recording holds are of no use as motion."""


class PluginError(SupermapError):
    """A plugin is missing, broken, doubly named or wrongly configured."""


class ConfigError(SupermapError):
    """A configuration file or an option is wrong."""


class DetectorError(PluginError):
    """Weights are missing, or a model's tensors are not understood."""


class ModelError(PluginError):
    """Weights cannot be had, are not here, or are not those that the catalogue names."""


class EncoderError(PluginError):
    """A text encoder, or what it needs, is missing or not understood."""


class SessionError(SupermapError):
    """What was pushed into a mapping session does not fit what was pushed before."""


class AlignmentError(SupermapError):
    """A traversal cannot be placed in the map with confidence."""


class MemoryStoreError(SupermapError):
    """The map database cannot be opened, is none of ours, or refuses a write."""


class QueryError(SupermapError):
    """A question is not understood."""


class ExportError(SupermapError):
    """An export cannot be written as asked."""


class EvaluationError(SupermapError):
    """A map and a ground truth do not belong together, or cannot be compared."""


class SimulationError(SupermapError):
    """A simulation cannot be made or written as asked."""


class TruthError(SupermapError):
    """A ground-truth file is missing, damaged, or none at all."""
