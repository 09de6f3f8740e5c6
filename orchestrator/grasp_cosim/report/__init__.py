"""Pages and pictures of any result."""
