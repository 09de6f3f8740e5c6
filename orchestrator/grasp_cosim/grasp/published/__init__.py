"""The tables and figures of the paper beside ours, and its claims."""
