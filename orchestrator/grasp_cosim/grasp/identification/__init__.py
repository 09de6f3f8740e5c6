"""What the bench's friction must be, from contact times or from a recorded log."""
