"""Where weights lie on this machine: a folder for each model, with its files and a record of where they came from."""

from __future__ import annotations

import os
from pathlib import Path

from platformdirs import user_data_dir

FOLDER_VARIABLE = "SUPERMAP_MODELS"
"""Environment variable: the models folder, in place of the one in the user's data folder."""


def models_folder() -> Path:
    """The folder of all models: `SUPERMAP_MODELS`, else `models` in the user's data folder. It need not exist."""
    named = os.environ.get(FOLDER_VARIABLE, "").strip()
    return Path(named).expanduser() if named else Path(user_data_dir("supermap")) / "models"
