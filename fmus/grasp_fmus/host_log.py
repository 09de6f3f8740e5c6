"""The host's logger, called directly.

pythonfmu 0.7.0 passes messages on only while debug logging is on, and those of a failed call only
as the bare repr of an exception. What it hands to the slave as "logger" is the address of an object
that holds the callbacks of the host, from which this module takes the logger.
"""

import ctypes
import sys
from collections.abc import Callable

Log = Callable[[int, str], None]
"""Logs a message with an FMI status."""

WARNING, DISCARD, ERROR = 1, 2, 3
"""FMI statuses."""

CATEGORIES = {WARNING: "logStatusWarning", DISCARD: "logStatusDiscard", ERROR: "logStatusError"}
"""The categories in use, by status; their names are those of the FMI standard."""

_LOGGER = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p
)
_NAME, _NAME_LENGTH, _SHORT_NAME, _CALLBACKS, _ENVIRONMENT = 0x10, 0x18, 0x20, 0x48, 0x20
"""Offsets, in the object: the instance name (a std::string of libstdc++) and the address of
fmi2CallbackFunctions, which begins with the logger; in that: componentEnvironment."""


def host_log(address: int, name: bytes) -> Log | None:
    """Return the logger of the host for an instance; None where it is not where it should be.

    `address` is that of pythonfmu's logger. The instance name, found where it is expected, is the
    proof that the layout is the known one: that of 64 bit Linux. There a string of up to 15 bytes
    stands in the object itself. A host without a logger gets none.
    """
    if sys.platform != "linux" or _word(address + _NAME_LENGTH) != len(name):
        return None
    text_at = _word(address + _NAME)
    if len(name) <= 15 and text_at != address + _SHORT_NAME:
        return None
    if ctypes.string_at(text_at, len(name)) != name:
        return None
    callbacks = _word(address + _CALLBACKS)
    logger, environment = _word(callbacks), _word(callbacks + _ENVIRONMENT)
    if not logger:
        return lambda *_: None
    call = _LOGGER(logger)

    def log(status: int, message: str) -> None:
        text = as_format(message).encode(errors="replace")
        call(environment, name, status, CATEGORIES[status].encode(), text)

    return log


def as_format(message: str) -> str:
    """Return the message for a host's logger, which is a printf."""
    return message.replace("%", "%%")


def _word(address: int) -> int:
    return ctypes.c_size_t.from_address(address).value
