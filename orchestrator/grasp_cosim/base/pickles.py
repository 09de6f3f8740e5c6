"""What goes to another process, as bytes, what a script or a notebook defines among it."""

import io
import pickle
from types import FunctionType
from typing import Any


class _Pickler(pickle.Pickler):
    """Refuses what a script or a notebook defines, which other processes do not find."""

    def reducer_override(self, value: Any) -> Any:
        """PicklingError for such a thing."""
        if isinstance(value, FunctionType | type) and value.__module__ == "__main__":
            raise pickle.PicklingError(f"{value.__qualname__} is of a script or a notebook")
        return NotImplemented


def as_bytes(value: Any) -> bytes:
    """The value for another process, which unpickles it.

    With cloudpickle, where it is installed, also what a script or a notebook defines. Raises what
    pickle does where it cannot go there.
    """
    buffer = io.BytesIO()
    try:
        _Pickler(buffer).dump(value)
    except Exception:  # it has one for each reason
        try:
            import cloudpickle
        except ModuleNotFoundError:
            cloudpickle = None
        if cloudpickle is None:
            raise
        return cloudpickle.dumps(value)  # type: ignore[no-any-return]
    return buffer.getvalue()
