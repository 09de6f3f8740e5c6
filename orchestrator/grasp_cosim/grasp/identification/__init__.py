"""The friction of the bench, from contact times or from a recorded log, by least squares."""
