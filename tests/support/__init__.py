"""What tests share: recordings, worlds and memories that they make, and ways to run commands."""
