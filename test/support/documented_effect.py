"""The example of doc/effects.md: an effect in a file, a scene and a program."""

from __future__ import annotations

import re

from support.paths import ROOT

DOC = (ROOT / 'doc/effects.md').read_text('utf-8')
BLOCKS = re.findall(r'^```(\w+)\n(.*?)^```$', DOC, re.DOTALL | re.MULTILINE)
FILES = {
    text.partition('\n')[0].removeprefix('# '): text for kind, text in BLOCKS if kind != 'text'
}
