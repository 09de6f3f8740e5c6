"""The linear model of a system about a moment of its run, and the margins of a loop in it."""
