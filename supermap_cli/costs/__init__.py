"""What a build costs: time by stage, memory and disk, each measured in a process of its own."""
