"""The bench's side of a proxy: an FMU behind the wire protocol, and a bad network."""
