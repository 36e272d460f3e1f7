"""Sphinx, of the site that `doc/site/build.py` assembles and builds."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

from docstrings import restructured
from sources import ROOT

project = 'alf_ros'
author = 'alf_ros maintainers'
version = release = ElementTree.parse(ROOT / 'package.xml').findtext('version', '')
extensions = ['myst_parser', 'sphinx.ext.autodoc']
root_doc = 'index'

# Code and links of the pages as GitHub reads them
highlight_language = 'text'
smartquotes_action = 'qe'  # no dashes: help texts name options, as --limits
myst_enable_extensions = ['colon_fence']
myst_heading_anchors = 4
suppress_warnings = ['myst.header']  # levels of headings are those of the pages

# Names of this package must be found. Others are documented elsewhere, and the site is built
# offline; aliases of arrays are explained on the page of the Python API.
nitpicky = True
nitpick_ignore_regex = [
    ('py:.*', r'^(?!alf_ros).*'),
    ('py:.*', r'alf_ros\.arrays\..*'),
    # what no program of a user makes or names
    ('py:.*', r'alf_ros\.(kernel|mechanism|model|logs\.progress)\..*'),
    ('py:.*', r'alf_ros\.simulation\.(applied|dynamics|instruments|kinematics|reactions)\..*'),
    ('py:.*', r'alf_ros\.simulation\.(input_values|state_direction)\..*'),
    ('py:.*', r'alf_ros\.scene\.text\.scene_document\..*'),
    ('py:.*', r'alf_ros\.studies\.identification\.(window_runs|window_start)\..*'),
    ('py:.*', r'alf_ros\.simulation\.(formulations|parameter_slopes|start|tangent_following)\..*'),
    ('py:.*', r'alf_ros\.studies\.statics\.(instant|path_course|varied_scene)\..*'),
    ('py:.*', r'alf_ros\.studies\.atlas\.(coordinate_reader|configuration_curve)\..*'),
    ('py:.*', r'alf_ros\.studies\.optimisation\.(design_quantity|instants|path_error)\..*'),
    ('py:.*', r'alf_ros\.studies\.optimisation\.(design_goal\.Asked|optimisation\.Report)'),
    ('py:.*', r'alf_ros\.studies\.closing\.posture\.Ways'),
]

autodoc_member_order = 'bysource'
autodoc_typehints = 'signature'
autodoc_preserve_defaults = True
autodoc_type_aliases = {name: f'alf_ros.arrays.{name}' for name in ('Floats', 'Integers')}
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 80

html_theme = 'furo'
html_title = f'alf_ros {release}'
html_static_path = ['static']
html_css_files = ['look.css']
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False


def setup(app: Any) -> None:
    """Docstrings of this package are plain text."""
    app.connect('autodoc-process-docstring', _process)


def _process(
    app: Any, what: str, name: str, found: object, options: Any, lines: list[str]
) -> None:
    lines[:] = restructured(lines)
