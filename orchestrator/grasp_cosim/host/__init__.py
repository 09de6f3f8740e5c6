"""What an FMU needs of this machine, and what it says about itself."""
