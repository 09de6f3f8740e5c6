"""The commands, each in a file of its name: a new one needs no other change."""
