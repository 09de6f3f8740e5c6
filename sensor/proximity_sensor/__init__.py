"""The optical proximity sensor. Equations: sensor/README.md."""
