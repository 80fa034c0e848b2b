"""XML from strangers: parsed without entities, network or unbounded size, with the line of every element.

A document type declaration is refused outright: it is the only place where entities (and so XML bombs and the
inclusion of other files) can be declared, and no robot description needs one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Never

from ..errors import DescriptionError
from .description import Repair

MAX_BYTES = 64 * 1024 * 1024
"""Largest description file that is read; the largest robots known take about 1 MB."""

MAX_ELEMENTS = 500_000
"""Largest number of elements in one file."""


def read_text(path: Path) -> bytes:
    """The bytes of a description file, or `DescriptionError` if it is missing, not a file, or too large."""
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise DescriptionError(f"{path} has {size / 1e6:.0f} MB; a description may have {MAX_BYTES / 1e6:.0f} MB")
        return path.read_bytes()
    except FileNotFoundError:
        raise DescriptionError(f"{path} does not exist; expected a robot description file") from None
    except OSError as error:
        raise DescriptionError(f"{path} cannot be read: {error.strerror}") from error


class Document:
    """A parsed file: its root element, where each element stands, and what had to be repaired to read it."""

    def __init__(self, data: bytes, source: Path | str) -> None:
        self.source = Path(source)
        self.repairs: list[Repair] = []
        self.root = self._parse(data)

    def _parse(self, data: bytes) -> Any:
        from lxml import etree

        plain = data.replace(b"\0", b"").upper()  # also catches UTF-16
        if b"<!DOCTYPE" in plain or b"<!ENTITY" in plain:
            raise DescriptionError(
                f"{self.source}: declares a DOCTYPE or entities, which is refused (entities can make a small file grow "
                "without bound or read other files); remove the declaration"
            )
        parser = etree.XMLParser(
            resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False, recover=True,
            remove_comments=True, remove_pis=True,
        )  # fmt: skip
        try:
            root = etree.fromstring(data, parser)
        except etree.XMLSyntaxError as error:
            raise DescriptionError(f"{self.source}: not XML: {error}") from None
        prefixes: dict[str, int] = {}
        for entry in parser.error_log:
            if entry.type_name != "NS_ERR_UNDEFINED_NAMESPACE":
                raise DescriptionError(f"{self.source}:{entry.line}: malformed XML: {entry.message}")
            prefixes.setdefault(entry.message.split()[2], entry.line)
        if root is None:
            raise DescriptionError(f"{self.source}: not XML")
        for prefix, line in prefixes.items():
            problem = f"the prefix {prefix!r} is used but never declared, so that strict parsers refuse the file"
            self.repairs.append(Repair(f"{self.source.name}:{line}", problem, "read as if it were declared"))
        own = root.tag[: root.tag.index("}") + 1] if str(root.tag).startswith("{") else ""
        count = 0
        for element in root.iter():
            count += 1
            if own and str(element.tag).startswith(own):  # a default namespace on everything says nothing
                element.tag = element.tag[len(own) :]
        if count > MAX_ELEMENTS:
            raise DescriptionError(f"{self.source}: has {count} elements; a description may have {MAX_ELEMENTS}")
        return root

    def where(self, element: Any) -> str:
        """``file:line`` of *element* for a `Repair`."""
        return f"{self.source.name}:{element.sourceline}"

    def fail(self, element: Any, message: str) -> Never:
        """Raise `DescriptionError` that starts with the full path and the line of *element*."""
        raise DescriptionError(f"{self.source}:{element.sourceline}: {message}")

    def repair(self, element: Any, problem: str, remedy: str) -> None:
        """Report a repair at *element*."""
        self.repairs.append(Repair(self.where(element), problem, remedy))

    def attribute(self, element: Any, key: str, what: str) -> str:
        """A required attribute."""
        value = element.get(key)
        if value is None:
            self.fail(element, f"{what}: <{local(element)}> lacks the attribute {key!r}")
        return str(value)

    def numbers(self, element: Any, key: str, count: int, what: str, default: tuple[float, ...] | None = None) -> Any:
        """*count* finite numbers of an attribute, as a tuple; *default* where it is missing."""
        text = element.get(key)
        if text is None:
            if default is None:
                self.fail(element, f"{what}: <{local(element)}> lacks the attribute {key!r} ({count} numbers)")
            return default
        try:
            values = tuple(float(x) for x in text.split())
        except ValueError:
            hint = "; expand the xacro first" if "${" in text else ""
            self.fail(element, f"{what}: {key}={text!r} is not {_count(count)}{hint}")
        if len(values) != count:
            self.fail(element, f"{what}: {key}={text!r} has {len(values)} numbers; expected {count}")
        if not all(math.isfinite(v) for v in values):
            self.fail(element, f"{what}: {key}={text!r}; every number must be finite")
        return values

    def number(self, element: Any, key: str, what: str, default: float | None = None) -> float:
        """One finite number of an attribute."""
        value = self.numbers(element, key, 1, what, None if default is None else (default,))
        return float(value[0])


def _count(count: int) -> str:
    return "a number" if count == 1 else f"{count} numbers"


def local(element: Any) -> str:
    """The tag of *element* without namespace or prefix."""
    return str(element.tag).rsplit("}", 1)[-1].rsplit(":", 1)[-1]


def prefixed(element: Any) -> bool:
    """Whether the tag carries a namespace or a prefix: an extension, not part of the plain format."""
    return "}" in str(element.tag) or ":" in str(element.tag)


def plain_children(element: Any, tag: str) -> Iterator[Any]:
    """Children named *tag* without any prefix."""
    return (child for child in element if child.tag == tag)


def extension_attribute(element: Any, key: str) -> str | None:
    """An attribute named *key*, with any prefix or namespace or none."""
    for name, value in element.attrib.items():
        if name.rsplit("}", 1)[-1].rsplit(":", 1)[-1] == key:
            return str(value)
    return None
