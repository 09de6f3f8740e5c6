"""From block to FMU: declaration, slave adapter, model description, build. Equations:
fmus/README.md.
"""
