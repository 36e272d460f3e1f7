"""The declarations at the root of the repository agree with the package."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import yaml

from support.paths import ROOT


def test_the_citation_has_the_version_and_licence_of_the_package() -> None:
    package = ElementTree.parse(ROOT / 'package.xml')
    cited = yaml.safe_load((ROOT / 'CITATION.cff').read_text('utf-8'))
    assert cited['version'] == package.findtext('version')
    assert cited['license'] == package.findtext('license')
    assert cited['title'] == package.findtext('name')


def test_every_section_of_rep_2004_is_declared_and_its_links_lead_somewhere() -> None:
    text = (ROOT / 'QUALITY_DECLARATION.md').read_text('utf-8')
    assert re.findall(r'^\| (\d) ', text, re.MULTILINE) == [str(n) for n in range(1, 8)]
    links = re.findall(r'\]\(([^):]+)\)', text)
    named = re.findall(r'`((?:\w+/)*[\w.]+/?)`', text)
    files = [*links, *(name for name in named if '/' in name or name.endswith('.xml'))]
    assert len(files) > 5
    assert [name for name in files if not (ROOT / name).exists()] == []
