"""The notes of an archive: what was decided or passed over in reading it, and where."""

from collections.abc import Iterator
from contextlib import contextmanager


class Notes:
    """Texts with their places; the same text of several places is one line."""

    def __init__(self) -> None:
        self._places: dict[str, list[str]] = {}

    def add(self, place: str, text: str) -> None:
        """Note `text` of a place, once."""
        places = self._places.setdefault(text, [])
        if place not in places:
            places.append(place)

    @contextmanager
    def off(self) -> Iterator[None]:
        """Note nothing meanwhile."""
        kept = {text: list(places) for text, places in self._places.items()}
        try:
            yield
        finally:
            self._places = kept

    def lines(self) -> list[str]:
        """The notes in the order of their first places."""
        return [
            f"{places[0]}: {text}" + (f" ({len(places)} such)" if len(places) > 1 else "")
            for text, places in self._places.items()
        ]
