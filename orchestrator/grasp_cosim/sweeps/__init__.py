"""Many runs of one system: from a table of values to a table of metrics."""
