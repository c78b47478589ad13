"""What holds for all tests."""

import os

from hypothesis import settings

settings.register_profile("suite", deadline=None, derandomize="CI" in os.environ)  # a busy machine is no failure
settings.load_profile("suite")
