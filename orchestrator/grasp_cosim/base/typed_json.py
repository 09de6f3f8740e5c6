"""JSON decoded into typed data, for every file that has some: what does not fit is one line.

A type says what is valid, and how it is decoded:

    float, int, bool, str, None    such a value; a float may be written as a whole number
    Literal, X | Y                 one of these
    Annotated[X, Valid(...)]       a value of which Valid says more than X does
    tuple[X, ...], list[X]         a list
    Sequence[float or int]         a list of numbers, which becomes an array of 8 bytes a number
    Mapping[K, X], dict[K, X]      an object of any names
    a TypedDict                    an object with its entries, and maybe others of later versions
    a dataclass                    an object with its fields only; those with defaults may lack
    a type of `texts`              a string that stands for a value of it
    Any                            anything
"""

import json
from array import array
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from fractions import Fraction
from functools import partial
from types import NoneType, UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    NotRequired,
    Required,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

from .errors import InputError, choices, nearest

T = TypeVar("T")

MAX_SHOWN = 60
"""Characters of a value that a message shows."""

SCALARS: Mapping[type, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a string",
    NoneType: "null",
}
"""The types that JSON has a form for, in words."""


ARRAY_CODES: Mapping[Any, str] = {float: "d", int: "q"}
"""The types of numbers of which a Sequence becomes an array, and the type code of that."""


@dataclass(frozen=True, slots=True)
class Valid:
    """What is valid beyond a type: in words, as in "must be a number above 0", and as a test."""

    must: str
    test: Callable[[Any], bool]


@dataclass(frozen=True, slots=True)
class Text:
    """How a string stands for a value: what is valid, in words, and the value of one.

    `read` raises a ValueError or an ArithmeticError where the string stands for none.
    """

    must: str
    read: Callable[[str], Any]


FRACTION = Text("a fraction in a string, like '1/3'", Fraction)


@dataclass(frozen=True, slots=True)
class _Form:
    """The JSON of a type: what is valid, in words; whether a value is such; how it is decoded.

    `decode` takes a place and a value for which `fits` is true. Of lists and objects `fits` looks
    at nothing within them, so that `decode` can name the place that is wrong.
    """

    must: str
    fits: Callable[[Any], bool]
    decode: Callable[[str, Any], Any]


def json_in(place: str, text: str | bytes) -> Any:
    """The content of a text of JSON, or of the bytes of a file; InputError where it is none."""
    try:
        return json.loads(text if isinstance(text, str) else text.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{place}: is damaged, not JSON in UTF-8: {error}") from error


class Decoder:
    """Decodes JSON into typed data; `texts` says which types are written as strings, and how.

    It keeps the forms of the types that it has decoded, so that one is made for many files.
    """

    def __init__(self, texts: Mapping[type, Text] | None = None) -> None:
        self._texts: Mapping[Any, Text] = {Fraction: FRACTION, **(texts or {})}
        self._forms: dict[Any, _Form] = {}

    def decoded(self, kind: type[T], place: str, value: Any) -> T:
        """The value of type `kind` that a `value` of JSON stands for.

        InputError at the first entry that is not as it must be, in one line that begins with the
        `place`: "run.json: components: plant: step = 'fast'; must be a number or null".
        """
        try:
            return cast(T, self._decode(kind, place, value))
        except RecursionError as error:
            raise InputError(f"{place}: {error}") from error

    def _decode(self, kind: Any, place: str, value: Any) -> Any:
        return _decoded(self._form(kind), place, value)

    def _form(self, kind: Any) -> _Form:
        """The form of a type, which is worked out once."""
        if kind not in self._forms:
            self._forms[kind] = self._form_of(kind)
        return self._forms[kind]

    def _form_of(self, kind: Any) -> _Form:
        origin, arguments = get_origin(kind), get_args(kind)
        if kind in SCALARS:
            return _scalar(kind)
        if kind in self._texts:
            return _text(self._texts[kind])
        if is_typeddict(kind):
            return self._typed_dict(kind)
        if is_dataclass(kind):
            return self._dataclass(kind)
        if origin is Annotated:
            valid: Valid = kind.__metadata__[0]
            return _Form(valid.must, valid.test, _unchanged)
        if origin in (Required, NotRequired):
            return self._form(arguments[0])
        if origin is Literal:
            return _literal(arguments)
        if origin in (Union, UnionType):
            return self._union(arguments)
        if isinstance(origin, type) and issubclass(origin, Mapping):
            return self._mapping(*arguments)
        if origin in (tuple, list):
            return self._list(origin, arguments[0])
        if origin is Sequence:
            code = ARRAY_CODES.get(arguments[0])
            return self._list(partial(array, code) if code else tuple, arguments[0])
        return _Form("anything", lambda _: True, _unchanged)

    def _typed_dict(self, kind: Any) -> _Form:
        types = get_type_hints(kind, include_extras=True)

        def decode(place: str, value: dict[str, Any]) -> dict[str, Any]:
            _check_complete(place, value, kind.__required_keys__)
            content = dict(value)
            for name, kind_of_entry in types.items():
                if name in value:
                    content[name] = self._decode(kind_of_entry, f"{place}: {name}", value[name])
            return content

        return _Form("a JSON object", _is_object, decode)

    def _dataclass(self, kind: Any) -> _Form:
        types = get_type_hints(kind, include_extras=True)
        required = [
            field.name
            for field in fields(kind)
            if field.default is MISSING and field.default_factory is MISSING
        ]

        def decode(place: str, value: dict[str, Any]) -> Any:
            for name in value:
                if name not in types:
                    raise InputError(f"{place}: unknown entry {name!r}; {nearest(name, types)}")
            _check_complete(place, value, required)
            content = {
                name: self._decode(types[name], f"{place}: {name}", entry)
                for name, entry in value.items()
            }
            try:
                return kind(**content)
            except (InputError, ValueError, ArithmeticError) as error:
                raise InputError(f"{place}: {error}") from error

        return _Form("a JSON object", _is_object, decode)

    def _union(self, types: Sequence[Any]) -> _Form:
        forms = [self._form(kind) for kind in types]

        def decode(place: str, value: Any) -> Any:
            form = next(form for form in forms if form.fits(value))
            return form.decode(place, value)

        must = " or ".join(form.must for form in forms)
        return _Form(must, lambda value: any(form.fits(value) for form in forms), decode)

    def _mapping(self, key_type: Any, value_type: Any) -> _Form:
        def decode(place: str, value: dict[str, Any]) -> dict[Any, Any]:
            keys, values = self._form(key_type), self._form(value_type)
            content = {}
            for name, entry in value.items():
                key = _decoded(keys, place, name)
                content[key] = _decoded(values, f"{place}: {name}", entry)
            return content

        return _Form("a JSON object", _is_object, decode)

    def _list(self, container: Callable[[list[Any]], Any], entry_type: Any) -> _Form:
        def decode(place: str, value: list[Any]) -> Any:
            form = self._form(entry_type)
            entries = [
                _decoded(form, f"{place}[{number}]", entry) for number, entry in enumerate(value)
            ]
            return container(entries)

        return _Form("a list", _is_list, decode)


def _decoded(form: _Form, place: str, value: Any) -> Any:
    """The value in its type; InputError where it does not fit."""
    if not form.fits(value):
        raise _refused(place, value, form.must)
    return form.decode(place, value)


def _scalar(kind: type) -> _Form:
    accepted = (float, int) if kind is float else (kind,)
    return _Form(SCALARS[kind], lambda value: type(value) in accepted, _unchanged)


def _literal(values: Sequence[Any]) -> _Form:
    typed_values = {(type(value), value) for value in values}

    def fits(value: Any) -> bool:
        return type(value) in (str, int, bool) and (type(value), value) in typed_values

    return _Form(f"one of {choices(values)}", fits, _unchanged)


def _text(text: Text) -> _Form:
    def fits(value: Any) -> bool:
        if not isinstance(value, str):
            return False
        try:
            text.read(value)
        except (ValueError, ArithmeticError):
            return False
        return True

    return _Form(text.must, fits, lambda _, value: text.read(value))


def _unchanged(place: str, value: Any) -> Any:
    return value


def _is_object(value: Any) -> bool:
    return isinstance(value, dict)


def _is_list(value: Any) -> bool:
    return isinstance(value, list)


def _check_complete(place: str, value: Collection[str], required: Collection[str]) -> None:
    """InputError where an object lacks an entry that it must have."""
    for name in required:
        if name not in value:
            raise InputError(f"{place}: no entry {name!r}; must have one")


def _refused(place: str, value: Any, must: str) -> InputError:
    text = repr(value)
    shown = text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}..."
    return InputError(f"{place} = {shown}; must be {must}")
