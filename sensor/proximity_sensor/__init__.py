"""The optical proximity sensor. Card: sensor/README.md."""
