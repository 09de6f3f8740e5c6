"""What an FMU is, whether this machine loads it, and a system file to start from with it."""
