"""The parts of a build that are no stage: how it is set up, told late things, stopped, and gone on with."""
