"""Elements, attributes and text of a robot file that its format does not have there, or has once.

Simulators pass over them, as over a misspelt one, and know different extensions. No reader here
looks at them, so a report names them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from xml.etree import ElementTree

_OF_XML = '{http://www.w3.org/'
_TOLD = 60  # characters of a text that are told


def of(
    element: ElementTree.Element, known: Collection[str], several: Collection[str]
) -> Iterator[tuple[str, ElementTree.Element]]:
    """Such elements in another one, each after its tag without a name space.

    known: the tags that it may have; several: the tags that it may have several times.
    """
    seen = set()
    for each in element:
        if not isinstance(each.tag, str):  # a comment
            continue
        if each.tag not in known or each.tag in seen:
            yield each.tag.rpartition('}')[2], each
        elif each.tag not in several:
            seen.add(each.tag)


def attributes(
    element: ElementTree.Element, known: Mapping[str, Collection[str]]
) -> Iterator[str]:
    """Such attributes of an element, each as `TAG ATTRIBUTE`; of elements whose tag is not known
    none. Attributes of XML itself, such as `xml:base`, belong to every format.

    known: by tag the attributes that it may have.
    """
    for name in element.attrib if element.tag in known else ():
        if name not in known[element.tag] and not name.startswith(_OF_XML):
            yield f'{element.tag} {name.rpartition("}")[2]}'


def text(element: ElementTree.Element) -> str:
    """The text of an element that has none in its format, after its tag; '' without any."""
    words = (element.text, *(each.tail for each in element))
    found = ' '.join(' '.join(filter(None, words)).split())[:_TOLD]
    return f'{element.tag} {found!r}' if found else ''
