"""How results depend on the communication step."""
