"""Documents and docstrings are plain technical English; every public name has a docstring."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.paths import ROOT
from support.syntax import parsed, statements

ROOT_PAGES = ('README.md', 'CONTRIBUTING.md', 'SECURITY.md', 'QUALITY_DECLARATION.md')
PAGES = [ROOT / file for file in ROOT_PAGES]
PAGES += [ROOT / 'doc/site/index.md', *sorted((ROOT / 'doc').glob('*.md'))]
COLUMNS = 100
WORDS = 40

NOUN = 'a noun instead of a pronoun'
NAME_IT = 'name the thing'
INVERTED = 'subject before verb'
VERBS = 'is|are|was|were|has|goes|comes|came|lies|waits|follows|stays|remains|acts'
BANNED = {
    r'\b(that|those) of\b': NOUN,
    r'\b(for|of|to|by|from|with) (who|whom|whoever)\b': NOUN,
    r'(^|[.:;] )who(ever)? \w+': NOUN,
    rf'\bwhat ({VERBS})\b(?!.*\?)': NAME_IT,
    r'\b(that|it|this) takes\b(?! (part|place|effect|over))': 'state time, force or cost',
    r'\bthe rest of what\b': NAME_IT,
    r'\b(none|nothing) of (a|an|it|them|those|the)\b': 'a plain negation: does not, no',
    r'\ball the same\b': 'however, also',
    r'\bis there\b(?!.*\?)': 'exists',
    r'\brooms?\b': 'module, memory, space',
    r'\blet be\b': 'is allowed',
    r'\b(is|are|be|was|as|been) told\b': 'state, report, request',
    r'\b(is|are|was) said\b': 'name the document or the message',
    r'\b(are|is) lost\b': 'is dropped, fails, is not counted',
    r'\bat home in\b': 'is supported',
    r'\bdictates?\b': 'limits, sets',
    r'\banew\b': 'again',
    r'\bmeanwhile\b': 'during, at the same time',
    r'\b(go|goes|going|went) on\b': 'continue',
    r'\bbesides(?=[.,;:)]|$)': 'also, in addition',
    r'\bwhich it is\b': NAME_IT,
    r'\bneither more nor less\b': 'exactly',
    r'\bby the way\b|\bof course\b|\bsimply\b|\bobviously\b': 'no filler',
    r'^(beside|inside|behind|below|above|between) [^.,]*\b(stands?|lies?|stood)\b': INVERTED,
    r'^(so|nor|neither) (is|are|do|does|has|have|can)\b': INVERTED,
}
RULES = {re.compile(pattern, re.IGNORECASE): reason for pattern, reason in BANNED.items()}
# Between two sentences, or two cells of a table.
END = re.compile(r'(?<=[.!?])[)"*]*\s+(?=[("*`]*[A-Z`\d])|\s*\|\s*')

Line = tuple[int, str]


def prose(text: str) -> Iterator[Line]:
    """Lines by number, tables too, but no code, html, link definitions or generated parts."""
    fenced = after_blank = generated = False
    for number, line in enumerate(text.splitlines(), 1):
        if mark := re.match(r'<!-- (end of )?\w+ -->', line):  # benchmark/tables.py writes them
            generated = not mark[1]
        if line.startswith('```'):
            fenced = not fenced
        elif fenced or generated:
            pass
        elif re.match(r'<|\[[^\]]+\]: |!\[|`[^`]+`\.?$', line):
            yield number, ''
        elif line.startswith('    ') and after_blank:
            continue  # the next line of a block is code as well
        else:
            yield number, line
        after_blank = not line.strip()


def paragraphs(lines: Iterator[Line]) -> Iterator[list[Line]]:
    """Lines that belong together; each item of a list and each line of a table on its own."""
    block: list[Line] = []
    before = 0
    for number, line in lines:
        if block and (
            not line.strip() or number != before + 1 or re.match(r'\s*([-*] |\d+\. |[|#])', line)
        ):
            yield block
            block = []
        if line.strip():
            block.append((number, line))
        before = number
    if block:
        yield block


def plain(text: str) -> str:
    """A paragraph without marks: links as their texts, code as one word."""
    text = re.sub(r'`[^`]*`', '`x`', text)
    text = re.sub(r'!?\[([^\]]*)\]\([^)]*\)', r'\1', text)
    return re.sub(r'^\s*([-*#]+|\d+\.) +|\*\*', '', text)


def sentences(text: str) -> Iterator[tuple[int, str]]:
    """Sentences of a paragraph, or cells of a table, with the place where they begin."""
    start = 0
    for end in END.finditer(text):
        yield start, text[start : end.start()]
        start = end.end()
    yield start, text[start:]


def faults(text: str, most: int = WORDS) -> list[str]:
    """`line: phrase -> reason` of each fault in a document; `most` words in a sentence."""
    found: list[tuple[int, str]] = []
    found += [
        (number, f'{len(line)} columns -> {COLUMNS} at most')
        for number, line in prose(text)
        if len(line) > COLUMNS and not line.startswith('|')
    ]
    for block in paragraphs(prose(text)):
        joined = plain('\n'.join(line.strip() for _, line in block))
        for start, sentence in sentences(joined):
            words = re.findall(r'[^\W_]\S*|`x`', sentence)
            if len(words) > most and not joined.startswith('|'):
                place = block[0][0] + joined.count('\n', 0, start)
                found.append((place, f'{" ".join(words[:6])} … -> {len(words)} words'))
            for rule, reason in RULES.items():
                for hit in rule.finditer(sentence.replace('\n', ' ')):
                    place = block[0][0] + joined.count('\n', 0, start + hit.start())
                    found.append((place, f'{hit.group()} -> {reason}'))
    return [f'{number}: {fault}' for number, fault in sorted(found)]


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.parametrize('page', PAGES, ids=name)
def test_documents_are_plain(page: Path) -> None:
    found = faults(page.read_text('utf-8'))
    assert not found, '\n'.join(f'{name(page)}:{fault}' for fault in found)


@pytest.mark.parametrize(
    ('text', 'expected'),
    [
        ('A plain sentence.', []),
        ('```\nthat of those\n```\n\n    what is code\n    what is code\n', []),
        ('<!-- x -->\nwhat is made\n<!-- end of x -->\n', []),
        ('`what is code` and [a link](what is.md).', []),
        ('| `a` | that of the crank |', ['1: that of -> a noun instead of a pronoun']),
        ('It moves\nwhat is free.', ['2: what is -> name the thing']),
        ('First. Then\nmore. The force is that\nof the pin.', ['2: that of -> ' + NOUN]),
        ('x ' * 41, ['1: x x x x x x … -> 41 words']),
        ('- ' + 'x' * 99, ['1: 101 columns -> 100 at most']),
    ],
)
def test_the_linter(text: str, expected: list[str]) -> None:
    assert faults(text) == expected


# ------------------------------------------------------------------------------------- docstrings

# Classes that implement a protocol, whose methods have the docstrings.
IMPLEMENTS = {'GivenJoint': 'Given', 'JointPen': 'Pen'}
# What alf_ros/effects/contract/__init__.py says of every effect.
OF_EFFECTS = {'Parameters', 'force', 'friction', 'interval', 'potential', 'side', 'tangent'}
Definition = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def public(node: ast.Module | ast.ClassDef) -> Iterator[Definition]:
    """Public definitions of a module or a class, not those inside functions."""
    for item in node.body:
        if isinstance(item, Definition) and not item.name.startswith('_'):
            yield item


def without_docstring(modules: dict[str, ast.Module]) -> list[str]:
    """`module:line: name` of each public module, class, function and method without a docstring.

    A method needs none if a class that its class extends or implements has it with one.
    """
    explained = {
        each.name: {method.name for method in public(each) if ast.get_docstring(method)}
        for tree in modules.values()
        for each in public(tree)
        if isinstance(each, ast.ClassDef)
    }
    missing: list[str] = []
    for module, tree in modules.items():
        if not ast.get_docstring(tree):
            missing.append(f'{module}:1: the module')
        is_effect = module.startswith('effects/') and module.count('/') == 1
        for item in public(tree):
            if not (ast.get_docstring(item) or (is_effect and item.name in OF_EFFECTS)):
                missing.append(f'{module}:{item.lineno}: {item.name}')
            if not isinstance(item, ast.ClassDef):
                continue
            bases = [ast.unparse(base) for base in item.bases] + [IMPLEMENTS.get(item.name, '')]
            inherited = set().union(*(explained.get(base, set()) for base in bases))
            missing += [
                f'{module}:{each.lineno}: {item.name}.{each.name}'
                for each in public(item)
                if not ast.get_docstring(each) and each.name not in inherited
            ]
    return missing


@pytest.fixture(scope='module')
def modules() -> dict[str, ast.Module]:
    """All modules of the package, by path."""
    package = ROOT / 'alf_ros'
    found = {
        path.relative_to(package).as_posix(): parsed(path)
        for path in sorted(package.rglob('*.py'))
    }
    assert len(found) > 300
    return found


def test_public_functions_have_docstrings(modules: dict[str, ast.Module]) -> None:
    missing = without_docstring(modules)
    assert not missing, '\n'.join(missing)


# Python files outside the package: folders and a file.
OUTSIDE = ('test', 'benchmark', 'fuzz', 'scripts', 'doc', 'launch', 'setup.py')


def outside(place: str) -> dict[str, ast.Module]:
    """All Python files at a place of the repository, by path; at least one exists."""
    root = ROOT / place
    found = [root] if root.is_file() else sorted(root.rglob('*.py'))
    assert found
    return {name(path): parsed(path) for path in found}


# In a docstring that defines fields one after another a sentence may be long.
LONGEST = 150
CLAUSE = re.compile(r'(what|that|who)\b', re.IGNORECASE)


def unclear(modules: dict[str, ast.Module]) -> list[str]:
    """`module:line: phrase -> reason` of each fault in a docstring, private ones too.

    A docstring names a thing or an action: it does not begin with a relative clause.
    """
    found: list[str] = []
    for module, tree in modules.items():
        for node in statements(tree):
            if not isinstance(node, ast.Module | Definition):
                continue
            text = ast.get_docstring(node)
            if text is None:
                continue
            start = 1 if isinstance(node, ast.Module) else node.body[0].lineno
            places = [fault.partition(': ') for fault in faults(text, LONGEST)]
            found += [f'{module}:{start + int(line) - 1}: {what}' for line, _, what in places]
            if CLAUSE.match(text):
                found.append(f'{module}:{start}: {text.split()[0]} -> {NAME_IT}')
    return found


def test_docstrings_are_plain(modules: dict[str, ast.Module]) -> None:
    found = unclear(modules)
    assert not found, '\n'.join(found)


@pytest.mark.parametrize('place', OUTSIDE)
def test_docstrings_outside_the_package_are_plain(place: str) -> None:
    found = unclear(outside(place))
    assert not found, '\n'.join(found)


def test_an_unclear_docstring_is_found() -> None:
    text = '''"""A module."""
def of_those():
    """The force.

    It is that of the pin."""
def what():
    """What a pin needs."""
'''
    expected = [f'a.py:5: that of -> {NOUN}', f'a.py:7: What -> {NAME_IT}']
    assert unclear({'a.py': ast.parse(text)}) == expected


def test_a_missing_docstring_is_found() -> None:
    text = '''"""A module."""
class Base:
    """A base."""
    def shared(self):
        """A method."""
class Below(Base):
    def shared(self): ...
    def own(self): ...
    def _private(self): ...
def function():
    def nested(): ...
'''
    expected = ['a.py:6: Below', 'a.py:8: Below.own', 'a.py:10: function']
    assert without_docstring({'a.py': ast.parse(text)}) == expected
    effect = {'effects/a.py': ast.parse('def force(): ...\ndef pack(): ...\n')}
    assert without_docstring(effect) == ['effects/a.py:1: the module', 'effects/a.py:2: pack']
