"""Is a picture the one that is kept in docs?"""

import pytest


def assert_same_picture(drawn, kept, command):
    """An SVG to the letter; of a PNG a few pixels may be others, as another processor rounds."""
    if drawn.suffix == ".svg":
        assert drawn.read_text("utf-8") == kept.read_text("utf-8"), f"{kept.name}: {command}"
        return
    image = pytest.importorskip("matplotlib.image")
    new, old = image.imread(drawn), image.imread(kept)
    assert new.shape == old.shape, f"{kept.name}: {command}"
    assert (abs(new - old).max(axis=-1) > 0.1).mean() < 1e-3, f"{kept.name}: {command}"
