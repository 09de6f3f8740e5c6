"""The system description: what is connected, with which values, over which time."""
