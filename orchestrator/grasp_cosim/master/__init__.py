"""The fixed-step master: plan, loop, session."""
