"""One module a version, `v0001_initial` and so on; a released one is never edited."""
