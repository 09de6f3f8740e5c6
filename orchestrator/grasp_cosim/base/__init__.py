"""What every package may use: failures, checks, files, numbers and text, the end of a run."""
