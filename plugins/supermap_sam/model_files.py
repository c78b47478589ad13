"""The two files of a segmenter: an image encoder, and a decoder of prompts."""

from __future__ import annotations

from pathlib import Path

from supermap_cli.errors import DetectorError
from supermap_cli.weights.folder import models_folder


def find_model_files(encoder: Path | None, decoder: Path | None, segmenter: str) -> tuple[Path, Path]:
    """The files that the options name, else those in the user's data folder; the decoder lies beside the encoder.

    Raises `DetectorError` that says where to put them.
    """
    folder = models_folder() / segmenter
    if encoder is not None:
        folder = encoder.expanduser().parent
    found = {
        part: _one(folder, part, segmenter) if given is None else given.expanduser()
        for part, given in (("encoder", encoder), ("decoder", decoder))
    }
    return found["encoder"], found["decoder"]


def _one(folder: Path, part: str, segmenter: str) -> Path:
    models = sorted(path for path in folder.glob("*.onnx") if part in path.stem.lower())
    if len(models) == 1:
        return models[0]
    what = f"several files for its {part}" if models else f"no weights for its {part}, and SuperMap ships none"
    raise DetectorError(
        f"the segmenter {segmenter} has {what}",
        where=str(folder),
        cure=f"`supermap models pull {segmenter}` gets some; or say --option {segmenter}.{part}=PATH",
    )
