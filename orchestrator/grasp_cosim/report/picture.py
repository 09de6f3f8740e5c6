"""A figure that a notebook shows as it is; matplotlib must be there."""

from io import BytesIO

from matplotlib.figure import Figure


class Picture(Figure):
    """A figure without pyplot: no window, and it is freed with its last name."""

    def _repr_png_(self) -> bytes:
        file = BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()
