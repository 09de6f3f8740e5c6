"""The tables and figures of the paper next to the simulated ones, and its claims."""
