"""From block to FMU: declaration, slave adapter, model description, build. Card: fmus/README.md."""
