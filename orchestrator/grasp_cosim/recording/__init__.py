"""What a run leaves behind, and the listeners that keep it."""
