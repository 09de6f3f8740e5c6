"""The notes of an archive: what was decided or passed over in reading it, and where."""


class Notes:
    """Texts with their places; the same text of several places is one line."""

    def __init__(self) -> None:
        self._places: dict[str, list[str]] = {}

    def add(self, place: str, text: str) -> None:
        """Note `text` of a place, once."""
        places = self._places.setdefault(text, [])
        if place not in places:
            places.append(place)

    def lines(self) -> list[str]:
        """The notes in the order of their first places."""
        return [
            f"{places[0]}: {text}" + (f" ({len(places)} such)" if len(places) > 1 else "")
            for text, places in self._places.items()
        ]
